#include "chart_layers.hpp"

#include "theme.hpp"

#include <components/gui_client/fleet_watch.hpp>
#include <components/gui_client/freshness.hpp>
#include <components/gui_client/mission.hpp>

#include <QPainter>
#include <QPainterPath>

namespace atirma::console {
namespace {

QPainterPath hull(double length) {
    QPainterPath path;
    path.moveTo(0, -length * 0.55);
    path.cubicTo(length * 0.24, -length * 0.2, length * 0.25, length * 0.15, length * 0.17, length * 0.45);
    path.lineTo(-length * 0.17, length * 0.45);
    path.cubicTo(-length * 0.25, length * 0.15, -length * 0.24, -length * 0.2, 0, -length * 0.55);
    path.closeSubpath();
    return path;
}

/// 0 to 360; a boat that has not told its heading points where it goes.
double heading_deg(const boat_view& boat) {
    return static_cast<double>(boat.sailing ? boat.sailing->value.heading_deg
                                            : boat.position->value.course_over_ground_deg);
}

} // namespace

QPolygonF paint_route(QPainter& to, const chart_projection& projection, const std::vector<waypoint>& points,
                      const QPen& pen) {
    QPolygonF line;
    for (const auto& p : points) line << projection.to_pixels(p);
    to.setPen(pen);
    to.setBrush(Qt::NoBrush);
    if (points.size() > 2) to.drawPolygon(line);
    else to.drawPolyline(line);
    return line;
}

void paint_waypoint(QPainter& to, QPointF at, int number, const waypoint_look& look) {
    to.setPen(QPen(look.edge, 2));
    to.setBrush(look.fill);
    to.drawEllipse(at, look.radius, look.radius);
    to.setFont(font_of(11, QFont::Bold));
    to.setPen(look.ink);
    to.drawText(QRectF(at.x() - 14, at.y() - 9, 28, 18), Qt::AlignCenter, QString::number(number));
}

void paint_fence(QPainter& to, const chart_projection& projection, const chart_scene& scene) {
    if (!scene.seen || !scene.seen->sea) return;
    const auto& t = colours();
    to.setBrush(Qt::NoBrush);
    for (const auto& area : scene.seen->sea->fence().areas()) {
        QPainterPath path;
        for (const auto& ring : area.rings) {
            QPolygonF line;
            for (const auto& p : ring) line << projection.to_pixels(waypoint{p.latitude_deg, p.longitude_deg});
            path.addPolygon(line);
        }
        if (area.keep_out) {
            QColor fill = t.no_go;
            fill.setAlpha(90);
            to.fillPath(path, fill);
        }
        to.setPen(QPen(t.bad, 1.8, Qt::DashDotLine));
        to.drawPath(path);
    }
}

void paint_track(QPainter& to, const chart_projection& projection, const chart_scene& scene) {
    if (!scene.seen || scene.seen->track->empty()) return;
    const auto& track = *scene.seen->track;
    const auto& t = colours();
    to.setBrush(Qt::NoBrush);
    QPolygonF run;
    std::size_t begin = 0;
    if (scene.tail_s > 0)
        while (begin < track.size() && age_s(scene.now, track[begin].at) > scene.tail_s) ++begin;
    // Older parts are paler: in three steps, so that a run stays one line.
    auto shade_of = [&](const track_point& p) {
        double age = age_s(scene.now, p.at);
        return age < 300 ? 255 : age < 1800 ? 170 : 110;
    };
    auto flush = [&](const track_point& as, int shade) {
        if (run.size() > 1) {
            QColor colour = t.of(as.link);
            colour.setAlpha(shade);
            to.setPen(QPen(colour, shade == 255 ? 2.4 : 1.9, as.history ? Qt::DotLine : Qt::SolidLine, Qt::RoundCap,
                           Qt::RoundJoin));
            to.drawPolyline(run);
        }
        auto last = run.isEmpty() ? QPointF() : run.back();
        run.clear();
        return last;
    };
    for (std::size_t i = begin; i < track.size(); ++i) {
        auto pixel = projection.to_pixels({track[i].latitude_deg, track[i].longitude_deg});
        if (i > begin) {
            const auto& before = track[i - 1];
            bool gap = is_outage(before, track[i], scene.seen->boat.rhythm);
            if (gap || before.link != track[i].link || before.history != track[i].history ||
                shade_of(before) != shade_of(track[i])) {
                auto last = flush(before, shade_of(before));
                if (!gap) run << last;
            }
        }
        if (run.isEmpty() || (run.back() - pixel).manhattanLength() > 1.2 || i + 1 == track.size()) run << pixel;
    }
    flush(track.back(), shade_of(track.back()));
}

void paint_mission(QPainter& to, const chart_projection& projection, const chart_scene& scene) {
    if (!scene.seen || scene.seen->mission.points.empty()) return;
    const auto& t = colours();
    const auto& points = scene.seen->mission.points;
    auto line = paint_route(to, projection, points, QPen(t.route, 1.4, Qt::DashLine));
    std::size_t active =
        scene.seen->boat.sailing ? scene.seen->boat.sailing->value.waypoint_index : scene.seen->mission.active;
    bool sails = scene.seen->boat.sailing && (scene.seen->boat.sailing->value.mode == sailing_mode::automatic);
    if (active < points.size() && sails) {
        auto at = scene.boat();
        auto from = active > 0 ? active - 1 : points.size() - 1;
        auto goal = line[static_cast<int>(active)];
        bool on_leg = points.size() > 1 && (!at || lies_on_leg(points[from], points[active], *at,
                                                               scene.seen->boat.sailing->value.cross_track_error_m));
        if (on_leg) {
            to.setPen(QPen(t.leg, 2));
            to.drawLine(line[static_cast<int>(from)], goal);
        }
        if (at) { // it was sent there from somewhere: that is its leg then
            QColor thin = t.leg;
            thin.setAlpha(on_leg ? 140 : 255);
            to.setPen(on_leg ? QPen(thin, 1.2, Qt::DotLine) : QPen(thin, 2));
            to.drawLine(projection.to_pixels(*at), goal);
        }
    }
    for (std::size_t i = 0; i < points.size(); ++i) {
        bool goal = sails && i == active;
        paint_waypoint(to, line[static_cast<int>(i)], static_cast<int>(i) + 1,
                       waypoint_look{goal ? t.leg : t.route, t.card, t.card, goal ? 10.5 : 9.5});
    }
}

void paint_target(QPainter& to, const chart_projection& projection, const chart_scene& scene, const waypoint& target) {
    auto at = projection.to_pixels(target);
    to.setPen(QPen(colours().draft, 2, Qt::DashLine));
    if (auto from = scene.boat()) to.drawLine(projection.to_pixels(*from), at);
    to.setPen(QPen(colours().draft, 2.5));
    to.setBrush(colours().card);
    to.drawEllipse(at, 9, 9);
    to.setBrush(colours().draft);
    to.drawEllipse(at, 3, 3);
}

void paint_others(QPainter& to, const chart_projection& projection, const chart_scene& scene) {
    const auto& t = colours();
    to.setFont(font_of(11, QFont::DemiBold));
    for (const auto& one : scene.others) {
        const auto& boat = one.seen->boat;
        bool stale = freshness_of(boat.position, value_kind::position, boat, scene.now) == freshness::stale;
        auto pixel = projection.to_pixels(one.at);
        to.save();
        to.translate(pixel);
        to.rotate(heading_deg(boat));
        to.setPen(QPen(t.card, 2, Qt::SolidLine, Qt::RoundCap, Qt::RoundJoin));
        to.setBrush(stale ? t.ink3 : t.ink2);
        to.drawPath(hull(22));
        to.restore();
        QRectF label(pixel.x() + 13, pixel.y() - 9, QFontMetricsF(to.font()).horizontalAdvance(one.name) + 8, 18);
        auto open = count_open(*one.seen);
        if (open.worst) label.setWidth(label.width() + 12);
        QColor back = t.card;
        back.setAlpha(200);
        to.setPen(Qt::NoPen);
        to.setBrush(back);
        to.drawRoundedRect(label, 4, 4);
        to.setPen(stale ? t.ink3 : t.ink2);
        to.drawText(label.adjusted(4, 0, 0, 0), Qt::AlignVCenter, one.name);
        if (!open.worst) continue;
        to.setPen(Qt::NoPen);
        to.setBrush(t.of(open.worst->how));
        to.drawEllipse(QPointF(label.right() - 8, label.center().y()), 4, 4);
    }
}

void paint_boat(QPainter& to, const chart_projection& projection, const chart_scene& scene) {
    auto at = scene.boat();
    if (!at) return;
    const auto& t = colours();
    const auto& fix = *scene.seen->boat.position;
    auto how = freshness_of(scene.seen->boat.position, value_kind::position, scene.seen->boat, scene.now);
    auto pixel = projection.to_pixels(*at);
    // Where it goes in the next two minutes.
    double ahead = static_cast<double>(fix.value.speed_over_ground_mps) * 120 / projection.metres_per_pixel;
    if (how != freshness::stale && ahead > 6) {
        double course = static_cast<double>(fix.value.course_over_ground_deg) * std::numbers::pi / 180;
        QPointF tip = pixel + QPointF(std::sin(course), -std::cos(course)) * ahead;
        to.setPen(QPen(t.hull, 1.6, Qt::DashLine));
        to.drawLine(pixel, tip);
        to.setBrush(t.hull);
        to.setPen(Qt::NoPen);
        to.drawEllipse(tip, 2.5, 2.5);
    }
    if (how != freshness::fresh) { // it is no longer there: the ring grows with what it may have sailed
        double grown = std::clamp(age_s(scene.now, fix.measured_at) *
                                      std::max(0.5, static_cast<double>(fix.value.speed_over_ground_mps)) /
                                      projection.metres_per_pixel,
                                  20.0, 4000.0);
        QColor ring = t.of(how);
        ring.setAlpha(170);
        to.setPen(QPen(ring, 1.4, Qt::DotLine));
        ring.setAlpha(18);
        to.setBrush(ring);
        to.drawEllipse(pixel, grown, grown);
    }
    to.save();
    to.translate(pixel);
    to.rotate(heading_deg(scene.seen->boat));
    QColor body = how == freshness::stale ? t.ink3 : t.hull;
    to.setPen(QPen(t.card, 2.2, Qt::SolidLine, Qt::RoundCap, Qt::RoundJoin));
    to.setBrush(body);
    to.drawPath(hull(34));
    to.setPen(Qt::NoPen);
    to.setBrush(t.deck);
    to.drawPath(hull(17));
    if (scene.seen->boat.sailing) { // the boom
        to.setPen(QPen(t.ink, 2, Qt::SolidLine, Qt::RoundCap));
        to.translate(0, -5);
        to.rotate(-static_cast<double>(scene.seen->boat.sailing->value.sail_measured_deg));
        to.drawLine(QPointF(0, 0), QPointF(0, 18));
    }
    to.restore();
}

} // namespace atirma::console
