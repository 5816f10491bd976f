#include "instruments.hpp"

#include "chart_view.hpp"
#include "theme.hpp"
#include "units.hpp"

#include <components/gui_client/track_store.hpp>

#include <ise/core/time_text.hpp>

#include <QGridLayout>
#include <QPainter>

#include <algorithm>

namespace atirma::console {
namespace {

constexpr float slowest_course_mps = 0.05f; ///< below, a course over ground means nothing

/// Without a minus before zero.
QString whole(double value) { return QString::number(std::round(value) + 0.0, 'f', 0).replace('-', QChar(0x2212)); }
QString degrees(double value) {
    return QStringLiteral("%1").arg(std::fmod(std::round(value) + 360, 360), 3, 'f', 0, QLatin1Char('0'));
}

QString duration_text(double seconds) {
    auto s = static_cast<long long>(seconds);
    if (s >= 36000) return QStringLiteral("%1 h").arg(s / 3600);
    if (s >= 3600) return QStringLiteral("%1:%2 h").arg(s / 3600).arg(s / 60 % 60, 2, 10, QLatin1Char('0'));
    return QStringLiteral("%1:%2").arg(s / 60).arg(s % 60, 2, 10, QLatin1Char('0'));
}

/// The frame of an instrument whose value is `how` fresh, and its rectangle.
QRectF draw_card(QPainter& to, const QWidget& of, freshness how) {
    const auto& t = colours();
    QRectF box = QRectF(of.rect()).adjusted(0.5, 0.5, -0.5, -0.5);
    to.setRenderHint(QPainter::Antialiasing);
    to.setPen(QPen(how == freshness::stale ? t.of(how) : t.line, 1));
    to.setBrush(how == freshness::stale ? t.warn_back : t.card);
    to.drawRoundedRect(box, 8, 8);
    return box;
}

} // namespace

value_tile::value_tile(const QString& label, const QString& tip, QWidget* parent)
    : QWidget(parent), label_(label), tip_(tip) {
    setToolTip(tip);
    setAccessibleName(label);
    setSizePolicy(QSizePolicy::Expanding, QSizePolicy::Expanding);
}

void value_tile::show_value(const QString& value, const QString& unit, freshness how, double age_seconds) {
    value_ = how == freshness::none ? QString() : value;
    unit_ = unit;
    how_ = how;
    age_ = how == freshness::none ? QString() : text(age_text(age_seconds));
    setAccessibleDescription(value_.isEmpty() ? tr("unknown") : QStringLiteral("%1 %2, %3").arg(value_, unit_, age_));
    setToolTip(
        age_.isEmpty()
            ? tip_
            : QStringLiteral("%1\n%2 %3, %4").arg(tip_, value_, unit_, age_ == "now" ? age_ : tr("%1 old").arg(age_)));
    update();
}

void value_tile::paintEvent(QPaintEvent*) {
    QPainter to(this);
    const auto& t = colours();
    auto box = draw_card(to, *this, how_);
    auto small = font_of(smallest_text, QFont::DemiBold);
    to.setFont(small);
    to.setPen(t.ink3);
    QRectF head(8, 3, box.width() - 15, 17);
    to.drawText(head, Qt::AlignLeft | Qt::AlignVCenter, label_);
    if (!age_.isEmpty()) { // where it does not fit, its mark stays, and the tooltip has it
        double room = head.width() - QFontMetricsF(small).horizontalAdvance(label_) - 4;
        to.setFont(font_of(smallest_text));
        double wide = QFontMetricsF(to.font()).horizontalAdvance(age_);
        to.setPen(t.of(how_));
        if (wide <= room) to.drawText(head, Qt::AlignRight | Qt::AlignVCenter, age_);
        to.setPen(Qt::NoPen);
        to.setBrush(t.of(how_));
        if (wide + 10 <= room || wide > room)
            to.drawEllipse(QPointF(head.right() - (wide <= room ? wide + 7 : 3), head.center().y() + 0.5), 3, 3);
    }
    int size = box.height() < 54 ? 20 : 24;
    auto shown = value_.isEmpty() ? QStringLiteral("–") : value_;
    auto unit_font = font_of(smallest_text);
    auto unit = unit_;
    auto fits = [&] {
        return QFontMetricsF(font_of(size, QFont::DemiBold)).horizontalAdvance(shown) +
                   QFontMetricsF(unit_font).horizontalAdvance(unit) + 14 <=
               box.width();
    };
    while (size > smallest_text && !fits()) --size;
    while (!fits() && !unit.isEmpty()) // part by part; the tooltip has the rest
        unit.truncate(std::max<qsizetype>(0, unit.lastIndexOf("  ")));
    auto font = font_of(size, QFont::DemiBold);
    to.setFont(font);
    to.setPen(t.ink_of(how_));
    QFontMetricsF metrics(font);
    double base = box.height() - 8;
    to.drawText(QPointF(8, base), shown);
    if (value_.isEmpty()) return;
    to.setFont(unit_font);
    to.setPen(t.ink3);
    to.drawText(QPointF(8 + metrics.horizontalAdvance(shown) + 3, base), unit);
}

actuator_gauge::actuator_gauge(const QString& label, double low, double high, QWidget* parent)
    : QWidget(parent), label_(label), low_(low), high_(high) {
    setToolTip(tr("%1: the bar shows the measured angle, the mark the commanded one").arg(label));
    setAccessibleName(label);
    setSizePolicy(QSizePolicy::Expanding, QSizePolicy::Fixed);
}

void actuator_gauge::show_values(double commanded, double actual, freshness how, double age_seconds) {
    commanded_ = commanded;
    actual_ = actual;
    how_ = how;
    setAccessibleDescription(
        how == freshness::none
            ? tr("unknown")
            : tr("%1°, commanded %2°, %3").arg(whole(actual), whole(commanded), text(age_text(age_seconds))));
    update();
}

void actuator_gauge::paintEvent(QPaintEvent*) {
    QPainter to(this);
    const auto& t = colours();
    auto box = draw_card(to, *this, how_);
    const QRectF line(9, 3, box.width() - 18, 17);
    double left = line.width(); // for the label
    QRectF bar(10, box.height() - 17, box.width() - 20, 7);
    to.setPen(Qt::NoPen);
    to.setBrush(t.line);
    to.drawRoundedRect(bar, 3.5, 3.5);
    auto place = [&](double value) {
        return bar.left() + (std::clamp(value, low_, high_) - low_) / (high_ - low_) * bar.width();
    };
    double zero = place(0);
    if (how_ != freshness::none) {
        double x = place(actual_);
        to.setBrush(how_ == freshness::stale ? t.ink3 : t.accent);
        to.drawRoundedRect(QRectF(std::min(zero, x), bar.top(), std::max(3.0, std::abs(x - zero)), bar.height()), 3, 3);
        double wanted = place(commanded_);
        to.setBrush(t.hull);
        to.drawPolygon(
            QPolygonF({{wanted, bar.top() - 1}, {wanted - 4.5, bar.top() - 8}, {wanted + 4.5, bar.top() - 8}}));
        to.setFont(font_of(11, QFont::DemiBold));
        to.setPen(t.ink_of(how_));
        auto words = whole(actual_) + QStringLiteral("°");
        if (whole(commanded_) != whole(actual_))
            words = QStringLiteral("%1→%2°").arg(whole(actual_), whole(commanded_));
        to.drawText(line, Qt::AlignRight | Qt::AlignVCenter, words);
        left -= to.fontMetrics().horizontalAdvance(words) + 4;
    }
    to.setFont(font_of(smallest_text, QFont::DemiBold));
    to.setPen(t.ink3);
    to.drawText(line, Qt::AlignLeft | Qt::AlignVCenter,
                to.fontMetrics().elidedText(label_, Qt::ElideRight, static_cast<int>(left)));
    to.setPen(QPen(t.ink3, 1));
    to.drawLine(QPointF(zero, bar.top() - 1), QPointF(zero, bar.bottom() + 2));
}

instrument_panel::instrument_panel(QWidget* parent) : QWidget(parent) {
    auto* grid = new QGridLayout(this);
    grid->setContentsMargins(0, 0, 0, 0);
    grid->setSpacing(5);
    dial_ = new wind_dial(this);
    sog_ = add("sog", tr("SOG"), tr("Speed over ground"));
    cog_ = add("cog", tr("COG"), tr("Course over ground, true"));
    heading_ = add("heading", tr("HDG"), tr("Heading of the bow, true"));
    heel_ = add("heel", tr("HEEL"), tr("Positive: starboard side down"));
    dtw_ = add("dtw", tr("DTW"), tr("Distance to the waypoint"));
    btw_ = add("btw", tr("BTW"), tr("Bearing to the waypoint, true"));
    xte_ = add("xte", tr("XTE"), tr("Cross-track error: R right of the leg, L left"));
    eta_ =
        add("eta", tr("TTG"), tr("Time to the waypoint at the speed made good towards it, and time of arrival (UTC)"));
    wind_ = add("wind", tr("WIND"), tr("Direction and speed of the true wind"));
    battery_ = add("battery", tr("BATTERY"), tr("Charge, voltage, discharge current"));
    rudder_ = new actuator_gauge(tr("RUDDER"), -50, 50, this);
    sail_ = new actuator_gauge(tr("SAIL"), -90, 90, this);
    grid->addWidget(dial_, 0, 0, 3, 1);
    int n = 0;
    for (auto* tile : {sog_, cog_, heading_, dtw_, btw_, xte_, eta_, heel_, wind_}) {
        grid->addWidget(tile, n / 3, 1 + n % 3);
        ++n;
    }
    grid->addWidget(battery_, 3, 0);
    auto* gauges = new QWidget(this);
    auto* row = new QGridLayout(gauges);
    row->setContentsMargins(0, 0, 0, 0);
    row->setSpacing(5);
    row->addWidget(rudder_, 0, 0);
    row->addWidget(sail_, 0, 1);
    grid->addWidget(gauges, 3, 1, 1, 3);
    grid->setColumnStretch(0, 3);
    for (int column = 1; column < 4; ++column) grid->setColumnStretch(column, 2);
    for (int line = 0; line < 3; ++line) grid->setRowStretch(line, 1);
}

void instrument_panel::resizeEvent(QResizeEvent* event) {
    QWidget::resizeEvent(event);
    auto* grid = static_cast<QGridLayout*>(layout());
    grid->setColumnMinimumWidth(0, width() > 440 ? 182 : 126); // the dial grows first
}

value_tile* instrument_panel::add(const QString& name, const QString& label, const QString& tip) {
    auto* made = new value_tile(label, tip, this);
    made->setObjectName(name);
    tiles_.push_back(made);
    return made;
}

void instrument_panel::show_boat(const boat_view& boat, utc_time now) {
    dial_->show_boat(boat, now);
    auto fix_how = freshness_of(boat.position, value_kind::position, boat, now);
    auto nav_how = freshness_of(boat.sailing, value_kind::sailing, boat, now);
    auto wind_how = freshness_of(boat.breeze, value_kind::breeze, boat, now);
    auto power_how = freshness_of(boat.supply, value_kind::supply, boat, now);
    double fix_age = boat.position ? age_s(now, boat.position->measured_at) : 0,
           nav_age = boat.sailing ? age_s(now, boat.sailing->measured_at) : 0;
    location fix = boat.position ? boat.position->value : location();
    navigation nav = boat.sailing ? boat.sailing->value : navigation();
    sog_->show_value(QString::number(speed_value(static_cast<double>(fix.speed_over_ground_mps)), 'f', 1), speed_name(),
                     fix_how, fix_age);
    auto course_how = fix.speed_over_ground_mps >= slowest_course_mps ? fix_how : freshness::none;
    cog_->show_value(degrees(static_cast<double>(fix.course_over_ground_deg)), "°", course_how, fix_age);
    heading_->show_value(degrees(static_cast<double>(nav.heading_deg)), "°", nav_how, nav_age);
    heel_->show_value(whole(static_cast<double>(nav.heel_deg)), "°", nav_how, nav_age);
    // What does not apply is not shown: without a waypoint there is no distance to it, in Heading no leg, at rest no
    // course.
    bool on_legs = nav.mode == sailing_mode::automatic || nav.mode == sailing_mode::return_home;
    bool has_mark = nav.mode == sailing_mode::automatic ? nav.waypoint_count > 0
                                                        : on_legs || nav.mode == sailing_mode::station_keep;
    auto way_how = has_mark ? nav_how : freshness::none;
    auto leg_how = on_legs ? way_how : freshness::none;
    auto [far, far_unit] = distance_parts(static_cast<double>(nav.distance_to_waypoint_m));
    dtw_->show_value(far, far_unit, way_how, nav_age);
    btw_->show_value(degrees(static_cast<double>(nav.bearing_to_waypoint_deg)), "°", way_how, nav_age);
    auto off = static_cast<double>(nav.cross_track_error_m);
    xte_->show_value(whole(std::abs(off)), off > 0.5 ? tr("m R") : off < -0.5 ? tr("m L") : tr("m"), leg_how, nav_age);
    auto left = on_legs ? time_to_waypoint_s(boat) : std::nullopt;
    // From when the distance was measured: the arrival does not move away while nothing newer comes.
    auto then = (boat.sailing ? boat.sailing->measured_at : now) +
                std::chrono::seconds(static_cast<long long>(left.value_or(0)));
    eta_->show_value(left ? duration_text(*left) : QString(), text(ise::iso_8601(then).substr(11, 5)),
                     left ? std::max(way_how, fix_how) : freshness::none, std::max(fix_age, nav_age));
    wind breeze = boat.breeze ? boat.breeze->value : wind();
    wind_->show_value(degrees(static_cast<double>(breeze.true_direction_deg)) + "°",
                      QStringLiteral("%1 %2")
                          .arg(speed_value(static_cast<double>(breeze.true_speed_mps)), 0, 'f',
                               shown_units().speed == speed_unit::metres ? 1 : 0)
                          .arg(speed_name()),
                      wind_how, boat.breeze ? age_s(now, boat.breeze->measured_at) : 0);
    power supply = boat.supply ? boat.supply->value : power();
    battery_->show_value(QStringLiteral("%1").arg(supply.battery_percent),
                         QStringLiteral("%  %1 V  %2 A")
                             .arg(static_cast<double>(supply.battery_v), 0, 'f', 1)
                             .arg(static_cast<double>(supply.battery_a), 0, 'f', 1),
                         power_how, boat.supply ? age_s(now, boat.supply->measured_at) : 0);
    rudder_->show_values(static_cast<double>(nav.rudder_commanded_deg), static_cast<double>(nav.rudder_measured_deg),
                         nav_how, nav_age);
    // The sheet is a limit: the boom swings to leeward up to it.
    double sheet = static_cast<double>(nav.sail_commanded_deg) * (nav.sail_measured_deg < 0 ? -1 : 1);
    sail_->show_values(sheet, static_cast<double>(nav.sail_measured_deg), nav_how, nav_age);
}

} // namespace atirma::console
