#include "limits_dialog.hpp"

#include "number_box.hpp"
#include "theme.hpp"

#include <QDialogButtonBox>
#include <QFormLayout>
#include <QLabel>
#include <QPushButton>

namespace atirma::console {

limits_dialog::limits_dialog(const alarm_limits& now, QWidget* parent) : QDialog(parent), before_(now) {
    setObjectName("limits");
    setWindowTitle(tr("Alarm limits"));
    auto* column = new QVBoxLayout(this);
    auto* form = new QFormLayout;
    form->setHorizontalSpacing(18);
    form->setVerticalSpacing(7);
    auto add = [&](const char* name, const QString& words, const QString& tip, double low, double high,
                   const QString& unit) {
        auto* box = new number_box(low, high, this);
        box->setObjectName(name);
        box->setDecimals(0);
        box->setSuffix(" " + unit);
        box->setToolTip(tip);
        box->setMinimumWidth(110);
        form->addRow(words, box);
        all_.push_back(box);
        box->setProperty("words", words);
        connect(box, &QDoubleSpinBox::valueChanged, this, &limits_dialog::check);
        return box;
    };
    no_data_ = add("limit_no_data", tr("Nothing heard from the boat for"),
                   tr("Over any link; at least five periods of its telemetry"), 5, 86400, tr("s"));
    link_silent_ = add("limit_link_silent", tr("One link silent for"),
                       tr("While other links work; at least five periods of its telemetry"), 5, 86400, tr("s"));
    proxy_lost_ =
        add("limit_proxy_lost", tr("A link's proxy not reached for"), tr("On the shore's network"), 1, 3600, tr("s"));
    battery_low_ = add("limit_battery_low", tr("Battery low below"), tr("A warning"), 0, 100, "%");
    battery_critical_ =
        add("limit_battery_critical", tr("Battery critical below"), tr("At most the limit above"), 0, 100, "%");
    off_track_ =
        add("limit_off_track", tr("Off track by"), tr("In Auto and RTL, to either side of the leg"), 5, 10000, tr("m"));
    modem_hot_ = add("limit_modem_hot", tr("Shore modem hotter than"), tr("At 60 °C it begins to transmit less"), 20,
                     100, tr("°C"));
    duty_ = add("limit_duty", tr("Duty cycle used up to"), tr("At 100 % the modem stops transmitting"), 1, 100, "%");
    column->addLayout(form);
    trouble_ = new QLabel(this);
    trouble_->setObjectName("limits_trouble");
    trouble_->setWordWrap(true);
    trouble_->setMinimumHeight(2 * QFontMetrics(font_of(smallest_text)).lineSpacing());
    trouble_->setStyleSheet(QStringLiteral("color: %1").arg(colours().bad.name()));
    column->addWidget(trouble_);
    auto* buttons = new QDialogButtonBox(this);
    accept_ = buttons->addButton(tr("Use these"), QDialogButtonBox::AcceptRole);
    accept_->setObjectName("limits_accept");
    accept_->setProperty("role", "primary");
    buttons->addButton(tr("Cancel"), QDialogButtonBox::RejectRole);
    auto* usual = buttons->addButton(tr("Defaults"), QDialogButtonBox::ResetRole);
    connect(buttons, &QDialogButtonBox::accepted, this, &QDialog::accept);
    connect(buttons, &QDialogButtonBox::rejected, this, &QDialog::reject);
    connect(usual, &QPushButton::clicked, this, [this] { show_limits(alarm_limits()); });
    column->addWidget(buttons);
    show_limits(now);
}

void limits_dialog::show_limits(const alarm_limits& all) {
    no_data_->setValue(all.no_data_s);
    link_silent_->setValue(all.link_silent_s);
    proxy_lost_->setValue(all.proxy_lost_s);
    battery_low_->setValue(all.battery_low_percent);
    battery_critical_->setValue(all.battery_critical_percent);
    off_track_->setValue(all.off_track_m);
    modem_hot_->setValue(all.modem_hot_c);
    duty_->setValue(all.duty_percent);
    check();
}

void limits_dialog::check() {
    if (!accept_) return; // not complete yet
    QString trouble;
    for (const auto* each : all_)
        if (trouble.isEmpty() && !each->good())
            trouble = tr("%1: %2").arg(each->property("words").toString(), each->trouble());
    if (trouble.isEmpty() && battery_critical_->value() > battery_low_->value())
        trouble = tr("The critical limit is above the low one: the battery would never be only low");
    const auto& b = before_;
    const std::pair<number_box*, double> used[] = {{no_data_, b.no_data_s},
                                                   {link_silent_, b.link_silent_s},
                                                   {proxy_lost_, b.proxy_lost_s},
                                                   {battery_low_, b.battery_low_percent},
                                                   {battery_critical_, b.battery_critical_percent},
                                                   {off_track_, b.off_track_m},
                                                   {modem_hot_, b.modem_hot_c},
                                                   {duty_, b.duty_percent}};
    for (const auto& [box, value] : used) box->mark_changed(box->value() != value);
    trouble_->setText(trouble);
    accept_->setEnabled(trouble.isEmpty());
}

alarm_limits limits_dialog::limits() const {
    alarm_limits made;
    made.no_data_s = no_data_->value();
    made.link_silent_s = link_silent_->value();
    made.proxy_lost_s = proxy_lost_->value();
    made.battery_low_percent = static_cast<unsigned>(battery_low_->value());
    made.battery_critical_percent = static_cast<unsigned>(battery_critical_->value());
    made.off_track_m = off_track_->value();
    made.modem_hot_c = static_cast<int>(modem_hot_->value());
    made.duty_percent = static_cast<unsigned>(duty_->value());
    return made;
}

} // namespace atirma::console
