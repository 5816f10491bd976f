#include "instruments.hpp"

#include "theme.hpp"
#include "units.hpp"

#include <QPainter>
#include <QPainterPath>

namespace atirma::console {
namespace {

void pie(QPainter& to, double radius, double from_deg, double span_deg) { // clockwise from the bow
    QRectF box(-radius, -radius, 2 * radius, 2 * radius);
    to.drawPie(box, static_cast<int>((90 - from_deg - span_deg) * 16), static_cast<int>(span_deg * 16));
}

/// An arrow that comes in from the rim.
void arrow(QPainter& to, double radius, double at_deg, double length, const QColor& colour) {
    to.save();
    to.rotate(at_deg);
    QPainterPath path;
    path.moveTo(0, -radius + length);
    path.lineTo(-8, -radius + 2);
    path.lineTo(0, -radius + 7);
    path.lineTo(8, -radius + 2);
    path.closeSubpath();
    to.setPen(QPen(colours().card, 1.5));
    to.setBrush(colour);
    to.drawPath(path);
    to.restore();
}

} // namespace

wind_dial::wind_dial(QWidget* parent) : QWidget(parent) {
    setAccessibleName(tr("Wind dial"));
    setToolTip(tr("The bow is up. T true wind, A apparent wind; shaded: headings that the boat does not sail; "
                  "green mark: the waypoint; line: course over ground"));
    setSizePolicy(QSizePolicy::Expanding, QSizePolicy::Expanding);
}

void wind_dial::show_boat(const boat_view& boat, utc_time now) {
    boat_ = boat;
    now_ = now;
    wind_how_ = freshness_of(boat.breeze, value_kind::breeze, boat, now);
    sailing_how_ = freshness_of(boat.sailing, value_kind::sailing, boat, now);
    auto whole = [](float value) { return QString::number(static_cast<double>(value), 'f', 0); };
    QString said = tr("no heading");
    if (boat.sailing) said = tr("Heading %1°").arg(whole(boat.sailing->value.heading_deg));
    if (boat.breeze) said += tr(", true wind from %1°").arg(whole(boat.breeze->value.true_direction_deg));
    if (boat.breeze && apparent_holds())
        said += tr(", apparent wind at %1° from the bow").arg(whole(boat.breeze->value.apparent_angle_deg));
    setAccessibleDescription(said);
    update();
}

void wind_dial::paintEvent(QPaintEvent*) {
    QPainter to(this);
    to.setRenderHint(QPainter::Antialiasing);
    const auto& t = colours();
    double side = std::min(width(), height());
    double radius = side / 2 - 15;
    to.translate(width() / 2.0, height() / 2.0);
    to.setPen(QPen(t.line, 1));
    to.setBrush(t.card);
    to.drawEllipse(QPointF(), radius + 14, radius + 14);
    if (sailing_how_ == freshness::none) {
        to.setFont(font_of(12));
        to.setPen(t.ink3);
        to.drawText(QRectF(-radius, -12, 2 * radius, 24), Qt::AlignCenter, tr("no heading"));
        return;
    }
    if (sailing_how_ == freshness::stale) to.setOpacity(0.45);
    paint_wind(to, radius);
    paint_ring(to, radius);
    paint_middle(to, radius);
    paint_speeds(to, radius);
}

void wind_dial::paint_ring(QPainter& to, double radius) const {
    const auto& t = colours();
    double heading = static_cast<double>(boat_.sailing->value.heading_deg);
    for (int mark = 0; mark < 360; mark += 10) {
        to.save();
        to.rotate(mark - heading);
        bool main = mark % 30 == 0;
        to.setPen(QPen(main ? t.ink2 : t.ink3, main ? 1.6 : 1));
        to.drawLine(QPointF(0, -radius - 2), QPointF(0, -radius + (main ? 6 : 3)));
        to.restore();
        bool named = mark % 90 == 0;
        if (!named) continue;
        double angle = (mark - heading) * std::numbers::pi / 180;
        QPointF at(std::sin(angle) * (radius + 7.5), -std::cos(angle) * (radius + 7.5));
        static const char* const winds[4] = {"N", "E", "S", "W"};
        to.setFont(font_of(smallest_text, QFont::Bold));
        to.setPen(t.ink);
        to.drawText(QRectF(at.x() - 12, at.y() - 9, 24, 18), Qt::AlignCenter, QString(winds[mark / 90]));
    }
    to.setPen(Qt::NoPen);
    to.setBrush(t.ink);
    to.drawPolygon(QPolygonF({{0, -radius + 7}, {-5, -radius - 4}, {5, -radius - 4}})); // the bow
    if (boat_.sailing->value.waypoint_count > 0) {
        to.save();
        to.rotate(static_cast<double>(boat_.sailing->value.bearing_to_waypoint_deg) - heading);
        to.setBrush(t.good);
        to.drawPolygon(QPolygonF({{0, -radius + 12}, {-6, -radius + 2}, {0, -radius - 3}, {6, -radius + 2}}));
        to.restore();
    }
}

// The apparent wind is relative to the bow: with a newer heading it is invalid, while the true wind is not.
bool wind_dial::apparent_holds() const {
    if (!boat_.breeze || !boat_.sailing) return false;
    auto apart = boat_.sailing->measured_at - boat_.breeze->measured_at;
    return std::chrono::abs(apart) <= std::chrono::seconds(15);
}

void wind_dial::paint_wind(QPainter& to, double radius) const {
    if (!boat_.breeze || wind_how_ == freshness::none) return;
    const auto& t = colours();
    const auto& w = boat_.breeze->value;
    double heading = static_cast<double>(boat_.sailing->value.heading_deg);
    double from = static_cast<double>(w.true_direction_deg) - heading;
    double upwind = boat_.settings ? static_cast<double>(boat_.settings->value.forbidden_angle_upwind_deg) : 0;
    double downwind = boat_.settings ? static_cast<double>(boat_.settings->value.forbidden_angle_downwind_deg) : 0;
    to.setPen(Qt::NoPen);
    QColor shade = t.no_go;
    shade.setAlpha(t.dark ? 190 : 120);
    to.setBrush(shade);
    if (upwind > 0) pie(to, radius, from - upwind, 2 * upwind);
    if (downwind > 0) pie(to, radius, from + 180 - downwind, 2 * downwind);
    if (wind_how_ == freshness::stale) to.setOpacity(0.4);
    arrow(to, radius, from, 30, t.true_wind);
    // Further in: the two often lie close together.
    if (apparent_holds()) arrow(to, radius * 0.66, static_cast<double>(w.apparent_angle_deg), 20, t.apparent_wind);
    if (sailing_how_ != freshness::stale) to.setOpacity(1);
}

void wind_dial::paint_middle(QPainter& to, double radius) const {
    const auto& t = colours();
    double size = radius * 0.62;
    double heading = static_cast<double>(boat_.sailing->value.heading_deg);
    if (boat_.position && boat_.position->value.speed_over_ground_mps > 0.1f) {
        to.save();
        to.rotate(static_cast<double>(boat_.position->value.course_over_ground_deg) - heading);
        to.setPen(QPen(t.hull, 1.6, Qt::DashLine));
        to.drawLine(QPointF(0, 0), QPointF(0, -radius + 10));
        to.restore();
    }
    QPainterPath hull;
    hull.moveTo(0, -size * 0.6);
    hull.cubicTo(size * 0.26, -size * 0.22, size * 0.28, size * 0.18, size * 0.19, size * 0.5);
    hull.lineTo(-size * 0.19, size * 0.5);
    hull.cubicTo(-size * 0.28, size * 0.18, -size * 0.26, -size * 0.22, 0, -size * 0.6);
    to.setPen(QPen(t.hull, 1.8));
    to.setBrush(t.card);
    to.drawPath(hull);
    const auto& n = boat_.sailing->value;
    to.setPen(QPen(t.ink, 2.6, Qt::SolidLine, Qt::RoundCap));
    to.save();
    to.translate(0, -size * 0.2);
    to.rotate(-static_cast<double>(n.sail_measured_deg));
    to.drawLine(QPointF(0, 0), QPointF(0, size * 0.6));
    to.restore();
    to.save();
    to.translate(0, size * 0.5);
    to.rotate(static_cast<double>(n.rudder_measured_deg));
    to.setPen(QPen(t.accent, 2.6, Qt::SolidLine, Qt::RoundCap));
    to.drawLine(QPointF(0, 0), QPointF(0, size * 0.2));
    to.restore();
}

// In the corners below the dial, where no arrow is drawn.
void wind_dial::paint_speeds(QPainter& to, double radius) const {
    if (!boat_.breeze || wind_how_ == freshness::none) return;
    const auto& t = colours();
    to.setFont(font_of(11, QFont::DemiBold));
    auto speed = [](float mps) { return QString::number(speed_value(static_cast<double>(mps)), 'f', 0); };
    double low = radius + 14 - 13;
    QRectF box(-radius - 14, low, 2 * radius + 28, 14);
    to.setPen(t.true_wind);
    to.drawText(box, Qt::AlignLeft | Qt::AlignBottom, "T " + speed(boat_.breeze->value.true_speed_mps));
    to.setPen(t.apparent_wind);
    to.drawText(box, Qt::AlignRight | Qt::AlignBottom,
                apparent_holds() ? "A " + speed(boat_.breeze->value.apparent_speed_mps) : QStringLiteral("A –"));
}

} // namespace atirma::console
