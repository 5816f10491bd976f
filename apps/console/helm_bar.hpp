#pragma once
#include "actions.hpp"

#include <components/gui_client/view.hpp>

#include <QWidget>

#include <vector>

class QComboBox;
class QLabel;
class QPushButton;

namespace atirma::console {

/// Modes, turns and the link for commands: always visible, below the chart.
class helm_bar : public QWidget {
    Q_OBJECT
public:
    explicit helm_bar(operator_actions& actions, QWidget* parent = nullptr);
    void show_snapshot(const snapshot& seen, utc_time now);

private:
    operator_actions& actions_;
    std::vector<std::pair<sailing_mode, QPushButton*>> modes_;
    QComboBox* link_;
    QLabel* last_;
};

} // namespace atirma::console
