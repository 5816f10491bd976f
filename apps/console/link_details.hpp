#pragma once
#include "actions.hpp"

#include <components/gui_client/view.hpp>

#include <QWidget>

#include <memory>
#include <string>

class QComboBox;
class QGridLayout;
class QLabel;
class QProgressBar;

namespace atirma::console {

/// Values with their names, two to a line; screen readers get both.
class value_grid {
public:
    explicit value_grid(QWidget* of);
    /// Adds a value with its name; `wide`: on a line of its own.
    QLabel* add(const QString& name, const QString& tip, bool wide = false);
    QGridLayout* layout() const noexcept { return grid_; }
    static QLabel* small(const QString& words, QWidget* parent);

private:
    QWidget* of_;
    QGridLayout* grid_;
    int row_ = 0, column_ = 0;
};

/// The values that only one kind of link has, below those of all links.
class link_details : public QWidget {
public:
    using QWidget::QWidget;
    virtual void show_link(const link_view& link, utc_time now) = 0;
    /// For the reports of the proxy of `link`; null if it has none of its own yet.
    static link_details* make(const link_view& link, operator_actions& actions, QWidget* parent);
};

/// The modem on shore: power, duty cycle, temperature, failures.
class xbee_details final : public link_details {
public:
    xbee_details(std::string path, operator_actions& actions, QWidget* parent);
    void show_link(const link_view& link, utc_time now) override;

private:
    QComboBox* power_;
    QProgressBar* duty_;
    QLabel *temperature_, *failed_, *retries_, *answer_;
};

/// The mobile network: the boat's connection and unacknowledged packets.
class gprs_details final : public link_details {
public:
    explicit gprs_details(QWidget* parent);
    void show_link(const link_view& link, utc_time now) override;

private:
    QLabel *way_, *safe_, *behind_, *again_, *given_up_, *connections_, *half_open_, *today_, *month_, *budget_;
};

/// The satellite link: the last session, waiting telecommands, costs.
class iridium_details final : public link_details {
public:
    explicit iridium_details(QWidget* parent);
    void show_link(const link_view& link, utc_time now) override;

private:
    QLabel *session_, *place_, *today_, *month_, *budget_, *again_, *queue_;
};

} // namespace atirma::console
