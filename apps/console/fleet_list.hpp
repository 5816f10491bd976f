#pragma once
#include <components/gui_client/fleet_watch.hpp>

#include <QWidget>

#include <functional>

class QPushButton;
class QTableWidget;

namespace atirma::console {

/// All boats: the state of each, the last contact, its mode and its open alarms. Double click, Enter or the button
/// shows a boat.
class fleet_list : public QWidget {
    Q_OBJECT
public:
    explicit fleet_list(std::function<void(std::size_t boat)> show, QWidget* parent = nullptr);
    void show_fleet(const fleet_watch& fleet, std::size_t shown, utc_time now);
    /// The widget for the keys.
    QWidget* focus() const;

private:
    void offer();

    QTableWidget* table_;
    QPushButton* show_button_;
    std::function<void(std::size_t)> show_;
    std::size_t shown_ = 0;
};

} // namespace atirma::console
