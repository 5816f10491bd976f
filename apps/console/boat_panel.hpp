#pragma once
#include "actions.hpp"

#include <components/gui_client/view.hpp>

#include <QWidget>

#include <array>
#include <vector>

class QComboBox;
class QLabel;
class QPushButton;

namespace atirma::console {

class number_box;

/// The boat's parameters, confirmed and pending; telemetry periods; rare telecommands: status, beacon, reboot; the
/// boat's notices.
class boat_panel : public QWidget {
    Q_OBJECT
public:
    explicit boat_panel(operator_actions& actions, QWidget* parent = nullptr);
    void show_snapshot(const snapshot& seen, utc_time now);

private:
    struct row {
        parameter_id id{};
        QLabel *confirmed = nullptr, *state = nullptr;
        number_box* wanted = nullptr;
        QPushButton* set = nullptr;
        bool touched = false;
    };
    void show_row(row& of);
    QWidget* make_parameters();
    QWidget* make_periods();
    QWidget* make_rare();

    operator_actions& actions_;
    std::vector<row> rows_;
    std::array<QLabel*, link_count> periods_{};
    QLabel *health_, *notices_;
    QPushButton* beacon_;
    bool beacon_on_ = false;
};

} // namespace atirma::console
