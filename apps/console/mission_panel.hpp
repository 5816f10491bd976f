#pragma once
#include "actions.hpp"
#include "mission_draft.hpp"

#include <components/gui_client/view.hpp>

#include <QWidget>

#include <memory>

class QLabel;
class QProgressBar;
class QPushButton;
class QTableWidget;

namespace atirma::console {

/// The mission editor: the edited list beside the boat's list, place by place; upload, read back, compare.
class mission_panel : public QWidget {
    Q_OBJECT
public:
    mission_panel(mission_draft& draft, operator_actions& actions, QWidget* parent = nullptr);
    void show_snapshot(std::shared_ptr<const snapshot> seen, utc_time now);
    void set_editing(bool on);
    /// False: the component has ended, and takes no commands any more.
    void allow_commands(bool allowed);
    void forget() { fill(); } ///< the colours have changed
    /// An empty list, edited on the chart.
    void begin_new();

Q_SIGNALS:
    void edit_wanted(bool on);

private:
    void fill();
    void fill_state();
    void cell_edited(int row, int column);
    QPushButton* button(const QString& name, const QString& label, const QString& tip);

    mission_draft& draft_;
    operator_actions& actions_;
    std::shared_ptr<const snapshot> seen_;
    utc_time now_{};
    bool filling_ = false, allowed_ = true;
    QLabel *state_, *progress_text_;
    QProgressBar* progress_;
    QTableWidget* table_;
    QPushButton *edit_, *upload_, *read_, *cancel_, *take_over_, *undo_, *remove_, *up_, *down_, *go_, *new_;
};

} // namespace atirma::console
