#include "link_details.hpp"

#include "choice_box.hpp"
#include "theme.hpp"

#include <components/gui_client/freshness.hpp>
#include <components/xbee/at_command.hpp>

#include <QAbstractItemView>
#include <QComboBox>
#include <QGridLayout>
#include <QLabel>
#include <QProgressBar>

namespace atirma::console {

xbee_details::xbee_details(std::string path, operator_actions& actions, QWidget* parent) : link_details(parent) {
    auto* grid = new QGridLayout(this);
    grid->setContentsMargins(0, 0, 0, 0);
    grid->setHorizontalSpacing(8);
    grid->setVerticalSpacing(4);
    power_ = new choice_box(this);
    power_->setObjectName("power of " + text(path));
    power_->setAccessibleName(tr("Transmit power"));
    power_->setToolTip(tr("Transmit power of the modem on shore"));
    for (const auto& one : xbee::power_levels())
        power_->addItem(QStringLiteral("%1 · %2").arg(one.level).arg(text(std::string(one.label))));
    connect(power_, &QComboBox::activated, this, [path, &actions](int level) {
        set_xbee_parameter set;
        set.path = path;
        set.name = "power_level";
        set.value = static_cast<std::uint64_t>(level);
        actions.act(std::move(set));
    });
    duty_ = new QProgressBar(this);
    duty_->setRange(0, 100);
    duty_->setTextVisible(false);
    duty_->setAccessibleName(tr("Duty cycle"));
    duty_->setToolTip(
        tr("Used part of the allowed duty cycle over the last hour; at 100 % the modem stops transmitting"));
    temperature_ = rich_label(this);
    temperature_->setSizePolicy(QSizePolicy::Ignored, QSizePolicy::Preferred);
    failed_ = new QLabel(this);
    retries_ = new QLabel(this);
    answer_ = value_grid::small({}, this);
    answer_->setWordWrap(true);
    auto name = [&](const QString& words, int row, int column, QWidget* value) {
        grid->addWidget(value_grid::small(words, this), row, column);
        grid->addWidget(value, row, column + 1);
        value->setAccessibleDescription(words);
    };
    name(tr("Power"), 0, 0, power_);
    name(tr("Duty cycle"), 0, 2, duty_);
    name(tr("Failed"), 1, 0, failed_);
    name(tr("Modem"), 1, 2, temperature_);
    name(tr("Retries"), 2, 0, retries_);
    grid->addWidget(answer_, 2, 2, 1, 2);
    grid->setColumnStretch(1, 1);
    grid->setColumnStretch(3, 1);
    failed_->setToolTip(tr("Transmissions that exhausted their retries"));
    retries_->setToolTip(tr("Missing acknowledgements; each caused a retry"));
}

void xbee_details::show_link(const link_view& link, utc_time now) {
    if (!link.xbee) return;
    const auto& t = colours();
    const auto& modem = *link.xbee;
    bool old = link.xbee_at && age_s(now, *link.xbee_at) > 10;
    auto number = [&](auto value, const char* unit) {
        return value ? QStringLiteral("%1%2").arg(*value).arg(unit) : QStringLiteral("–");
    };
    if (!power_->view()->isVisible()) power_->setCurrentIndex(modem.power_level ? *modem.power_level : -1);
    power_->setEnabled(link.connected && modem.modem_ready);
    duty_->setValue(modem.duty_cycle_percent.value_or(0));
    auto warm = modem.temperature_c.value_or(0) >= 60;
    auto volts = modem.supply_mv ? QStringLiteral(" · %1 V").arg(*modem.supply_mv / 1000.0, 0, 'f', 2) : QString();
    temperature_->setText(QStringLiteral("<span style='color:%1'>%2</span>%3%4")
                              .arg((warm ? t.bad : t.ink).name(), number(modem.temperature_c, " °C"), volts,
                                   old ? tr(" · old") : QString()));
    failed_->setText(number(modem.failed_deliveries, ""));
    retries_->setText(number(modem.failed_acknowledgements, ""));
    answer_->setText(link.xbee_answer.empty()
                         ? tr("duty %1").arg(number(modem.duty_cycle_percent, " % of the hour's share"))
                         : text(link.xbee_answer));
}

} // namespace atirma::console
