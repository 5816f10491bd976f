#pragma once
#include <components/gui_client/alarm.hpp>

#include <QDialog>

#include <vector>

class QLabel;
class QPushButton;

namespace atirma::console {

class number_box;

/// The limits of the alarms. Contradictory figures cannot be accepted.
class limits_dialog : public QDialog {
    Q_OBJECT
public:
    explicit limits_dialog(const alarm_limits& now, QWidget* parent = nullptr);
    alarm_limits limits() const;

private:
    void show_limits(const alarm_limits& all);
    void check();

    alarm_limits before_;
    std::vector<number_box*> all_;
    number_box *no_data_, *link_silent_, *proxy_lost_, *battery_low_, *battery_critical_, *off_track_, *modem_hot_,
        *duty_;
    QLabel* trouble_;
    QPushButton* accept_ = nullptr;
};

} // namespace atirma::console
