#include "boat_panel.hpp"

#include "choice_box.hpp"
#include "number_box.hpp"
#include "theme.hpp"

#include <components/boat/parameters.hpp>
#include <components/gui_client/freshness.hpp>
#include <components/gui_client/track_store.hpp>
#include <components/gui_client/words.hpp>

#include <ise/core/time_text.hpp>

#include <QComboBox>
#include <QFrame>
#include <QGridLayout>
#include <QLabel>
#include <QPushButton>
#include <QScrollArea>

#include <cmath>

namespace atirma::console {
namespace {

QFrame* card(QWidget* parent) {
    auto* made = new QFrame(parent);
    made->setObjectName("card");
    return made;
}

QLabel* head(const QString& words, QWidget* parent) {
    auto* made = new QLabel(words, parent);
    made->setProperty("role", "head");
    return made;
}

QString in_units(float value, std::string_view unit) {
    auto shown = QString::number(static_cast<double>(value), 'g', 5);
    if (unit == "1") return shown;
    return shown + (unit == "deg" ? QStringLiteral("°") : " " + text(std::string(unit)));
}

} // namespace

boat_panel::boat_panel(operator_actions& actions, QWidget* parent) : QWidget(parent), actions_(actions) {
    auto* outer = new QVBoxLayout(this);
    outer->setContentsMargins(0, 2, 0, 0);
    auto* area = new QScrollArea(this);
    area->setWidgetResizable(true);
    area->setAccessibleName(tr("Boat"));
    area->setFrameShape(QFrame::NoFrame);
    area->setHorizontalScrollBarPolicy(Qt::ScrollBarAlwaysOff);
    auto* inside = new QWidget;
    auto* column = new QVBoxLayout(inside);
    column->setContentsMargins(0, 0, 2, 0);
    column->setSpacing(6);
    column->addWidget(make_parameters());
    column->addWidget(make_periods());
    column->addWidget(make_rare());
    column->addStretch(1);
    area->setWidget(inside);
    outer->addWidget(area);
}

QWidget* boat_panel::make_parameters() {
    auto* box = card(this);
    auto* grid = new QGridLayout(box);
    grid->setContentsMargins(11, 8, 11, 10);
    grid->setVerticalSpacing(1);
    grid->addWidget(head(tr("Parameter"), box), 0, 0);
    grid->addWidget(head(tr("On the boat"), box), 0, 1);
    grid->addWidget(head(tr("New"), box), 0, 2);
    int line = 1;
    for (const auto& info : parameters()) {
        row made;
        made.id = info.id;
        auto* name = new QLabel(text(label(info.id)), box);
        name->setToolTip(text(std::string(info.meaning)));
        name->setWordWrap(true); // in a narrow window the buttons stay in sight
        made.confirmed = rich_label(box);
        made.confirmed->setText("–");
        made.confirmed->setFixedWidth(104); // whatever the age: the boxes beside it stay where they are
        made.confirmed->setObjectName("confirmed_" + text(std::string(name_of(info.id))));
        made.wanted = new number_box(static_cast<double>(info.minimum), static_cast<double>(info.maximum), box);
        made.wanted->setObjectName("wanted_" + text(std::string(name_of(info.id))));
        made.wanted->setDecimals(info.maximum <= 1 ? 2 : 1);
        made.wanted->setSingleStep(info.maximum <= 1 ? 0.05 : 1);
        made.wanted->setValue(static_cast<double>(info.initial)); // until the boat reports its own
        made.wanted->setFixedWidth(92);
        made.wanted->setToolTip(
            tr("%1 to %2").arg(in_units(info.minimum, info.unit), in_units(info.maximum, info.unit)));
        made.wanted->setAccessibleName(tr("New: %1").arg(name->text()));
        auto* set = made.set = new QPushButton(tr("Set"), box);
        set->setAccessibleName(tr("Set %1").arg(name->text()));
        set->setObjectName("set_" + text(std::string(name_of(info.id))));
        made.state = rich_label(box);
        made.state->setObjectName("state_" + text(std::string(name_of(info.id))));
        auto kept = made.state->sizePolicy();
        kept.setRetainSizeWhenHidden(true); // the rows below stay where they are
        kept.setHorizontalPolicy(QSizePolicy::Ignored);
        made.state->setSizePolicy(kept);
        made.state->setFixedHeight(QFontMetrics(font_of(smallest_text)).lineSpacing());
        auto index = rows_.size();
        connect(made.wanted, &QDoubleSpinBox::valueChanged, this, [this, index] {
            rows_[index].touched = true;
            show_row(rows_[index]);
        });
        connect(set, &QPushButton::clicked, this, [this, index] {
            commands::set_parameter command{rows_[index].id, static_cast<float>(rows_[index].wanted->value())};
            if (!rows_[index].wanted->good()) return;
            if (actions_.give(command)) rows_[index].touched = false;
            show_row(rows_[index]);
        });
        grid->addWidget(name, line, 0);
        grid->addWidget(made.confirmed, line, 1);
        grid->addWidget(made.wanted, line, 2);
        grid->addWidget(set, line, 3);
        grid->addWidget(made.state, line + 1, 0, 1, 4);
        made.state->hide();
        rows_.push_back(made);
        line += 2;
    }
    grid->setColumnStretch(0, 1);
    return box;
}

QWidget* boat_panel::make_periods() {
    auto* box = card(this);
    auto* grid = new QGridLayout(box);
    grid->setContentsMargins(11, 8, 11, 10);
    grid->setVerticalSpacing(4);
    grid->addWidget(head(tr("Telemetry every"), box), 0, 0, 1, 3);
    for (std::size_t i = 0; i < link_count; ++i) {
        auto link = static_cast<link_id>(i);
        int line = static_cast<int>(i) + 1;
        periods_[i] = rich_label(box);
        periods_[i]->setText("–");
        auto* choice = new choice_box(box);
        choice->setObjectName("period_" + text(std::string(name_of(link))));
        choice->setAccessibleName(tr("Telemetry over %1 every").arg(text(label(link))));
        choice->addItem(tr("change…"), -1.0);
        for (double seconds : {0.0, 1.0, 2.0, 5.0, 10.0, 30.0, 60.0, 300.0, 600.0, 1800.0, 3600.0})
            choice->addItem(seconds == 0   ? tr("off")
                            : seconds < 60 ? tr("%1 s").arg(seconds)
                                           : tr("%1 min").arg(seconds / 60),
                            seconds);
        connect(choice, &QComboBox::activated, this, [this, choice, link](int index) {
            double seconds = choice->itemData(index).toDouble();
            choice->setCurrentIndex(0);
            if (seconds < 0) return;
            actions_.give(commands::set_telemetry_period{link, static_cast<float>(seconds)});
        });
        grid->addWidget(new QLabel(text(label(link)), box), line, 0);
        grid->addWidget(periods_[i], line, 1);
        grid->addWidget(choice, line, 2);
    }
    grid->setColumnStretch(1, 1);
    return box;
}

QWidget* boat_panel::make_rare() {
    auto* box = card(this);
    auto* column = new QVBoxLayout(box);
    column->setContentsMargins(11, 8, 11, 10);
    health_ = rich_label(box);
    health_->setWordWrap(true);
    health_->setFixedHeight(2 * QFontMetrics(font_of(smallest_text)).lineSpacing() + 2);
    column->addWidget(health_);
    auto* line = new QHBoxLayout;
    auto* status = new QPushButton(tr("Request status"), box);
    status->setToolTip(tr("One packet of each kind, at once"));
    connect(status, &QPushButton::clicked, this, [this] { actions_.give(commands::request_status()); });
    beacon_ = new QPushButton(tr("Beacon on…"), box);
    beacon_->setObjectName("beacon");
    beacon_->setMinimumWidth(QFontMetrics(font_of(smallest_text)).horizontalAdvance(tr("Beacon off…")) + 24);
    beacon_->setProperty("role", "danger");
    connect(beacon_, &QPushButton::clicked, this, [this] { actions_.give(commands::emergency_beacon{!beacon_on_}); });
    auto* reboot = new QPushButton(tr("Reboot…"), box);
    reboot->setObjectName("reboot");
    reboot->setProperty("role", "danger");
    connect(reboot, &QPushButton::clicked, this, [this] { actions_.give(commands::reboot()); });
    line->addWidget(status, 1);
    line->addWidget(beacon_);
    line->addWidget(reboot);
    column->addLayout(line);
    notices_ = new QLabel(box);
    notices_->setWordWrap(true);
    notices_->setProperty("role", "small");
    column->addWidget(notices_);
    return box;
}

/// Shows whether the typed value is in its range and whether it differs from the boat's.
void boat_panel::show_row(row& of) {
    auto trouble = of.wanted->trouble();
    of.wanted->mark_changed(of.touched);
    of.set->setEnabled(trouble.isEmpty());
    of.state->setVisible(!trouble.isEmpty() || of.touched);
    of.state->setToolTip(trouble);
    if (!trouble.isEmpty())
        of.state->setText(QStringLiteral("<span style='color:%1'>● %2</span>").arg(colours().bad.name(), trouble));
    else if (of.touched)
        of.state->setText(QStringLiteral("<span style='color:%1'>● %2</span>")
                              .arg(colours().accent.name(), tr("changed here, not sent")));
}

void boat_panel::show_snapshot(const snapshot& seen, utc_time now) {
    const auto& t = colours();
    for (auto& each : rows_) {
        const auto& is = seen.parameters.size() > static_cast<std::size_t>(each.id)
                             ? seen.parameters[static_cast<std::size_t>(each.id)]
                             : parameter_view();
        const auto* info = find_parameter(each.id);
        each.confirmed->setText(is.confirmed ? QStringLiteral("<b>%1</b> <span style='color:%2'>%3</span>")
                                                   .arg(in_units(*is.confirmed, info->unit), t.ink3.name(),
                                                        text(age_text(age_s(now, *is.confirmed_at))))
                                             : QStringLiteral("–"));
        if (auto value = is.pending ? is.pending : is.confirmed; value && !each.touched && !each.wanted->hasFocus()) {
            QSignalBlocker quiet(each.wanted);
            each.wanted->setValue(static_cast<double>(*value));
        }
        if (each.touched && is.confirmed && !is.pending &&
            std::abs(static_cast<double>(*is.confirmed) - each.wanted->value()) < 1e-6)
            each.touched = false;
        show_row(each);
        if (!each.wanted->good()) continue;
        if (each.touched) continue;
        QString words;
        if (is.pending)
            words = QStringLiteral("<span style='color:%1'>● %2</span>")
                        .arg(t.warn.name(), tr("%1 is pending").arg(in_units(*is.pending, info->unit)));
        else if (!is.problem.empty())
            words = QStringLiteral("<span style='color:%1'>● %2</span>")
                        .arg(t.bad.name(), text(is.problem).toHtmlEscaped());
        each.state->setText(words);
        each.state->setToolTip(text(is.problem));
        each.state->setVisible(!words.isEmpty());
    }
    for (std::size_t i = 0; i < link_count; ++i) {
        if (!seen.boat.settings) continue;
        auto period = seen.boat.settings->value.telemetry_period_s[i];
        periods_[i]->setText(period > 0
                                 ? QStringLiteral("<b>%1 s</b>").arg(static_cast<double>(period))
                                 : QStringLiteral("<span style='color:%1'>%2</span>").arg(t.ink3.name(), tr("off")));
    }
    if (seen.boat.supply) {
        const auto& p = seen.boat.supply->value;
        auto up = text(age_text(p.uptime_s));
        health_->setText(tr("Up %1 · last reset: %2 · hull %3 °C · %4")
                             .arg(up, text(std::string(name_of(p.last_reset))).replace('_', ' '))
                             .arg(static_cast<double>(p.temperature_c), 0, 'f', 1)
                             .arg(p.faults == 0 ? tr("no faults")
                                                : tr("<span style='color:%1'>faults %2</span>")
                                                      .arg(t.bad.name(), QString::number(p.faults, 16).toUpper())));
    } else {
        health_->setText(tr("Battery and faults are not known yet"));
    }
    beacon_on_ = seen.boat.sailing && seen.boat.sailing->value.beacon;
    beacon_->setText(beacon_on_ ? tr("Beacon off…") : tr("Beacon on…"));
    QStringList said;
    for (auto it = seen.boat.notices.rbegin(); it != seen.boat.notices.rend() && said.size() < 4; ++it)
        said << text(ise::iso_8601(it->measured_at).substr(11, 8)) + "  " + text(it->value.text);
    notices_->setVisible(!said.isEmpty());
    notices_->setText(said.join('\n'));
}

} // namespace atirma::console
