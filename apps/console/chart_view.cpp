#include "chart_view.hpp"

#include "theme.hpp"

#include <components/gui_client/freshness.hpp>
#include <components/gui_client/mission.hpp>

#include <QEvent>
#include <QPainter>
#include <QPainterPath>

namespace atirma::console {

chart_view::chart_view(mission_draft& draft, QWidget* parent) : QWidget(parent), draft_(draft) {
    setMinimumSize(280, 200);
    setMouseTracking(true);
    setFocusPolicy(Qt::StrongFocus);
    setObjectName("chart");
    setAccessibleName(tr("Chart"));
    connect(&draft_, &mission_draft::changed, this, [this] { update(); });
}

void chart_view::show_snapshot(std::shared_ptr<const snapshot> seen, utc_time now) {
    seen_ = std::move(seen);
    now_ = now;
    if (auto at = boat_place(); at && (follow_ || !placed_)) {
        auto pixel = projection_.to_pixels(*at);
        // The boat keeps to the middle part: the chart does not creep all the time.
        QRectF calm(width() * 0.12, height() * 0.12, width() * 0.76, height() * 0.76);
        if (!placed_ || !calm.contains(pixel)) {
            projection_.centre = *at;
            moved();
        }
        if (!placed_ && isVisible() && !seen_->mission.points.empty()) {
            placed_ = true;
            fit();
            zoom(0.6); // some of the coast beside them
        }
    }
    auto at = boat_place();
    setAccessibleDescription(
        at ? tr("The boat at %1, %2")
                 .arg(place_text(*at), text(age_text(age_s(now_, seen_->boat.position->measured_at))))
           : tr("No boat heard yet"));
    update();
}

std::optional<waypoint> chart_view::boat_place() const {
    if (!seen_ || !seen_->boat.position) return std::nullopt;
    const auto& at = seen_->boat.position->value;
    return waypoint{at.latitude_deg, at.longitude_deg};
}

void chart_view::moved() {
    base_valid_ = false;
    update();
}

void chart_view::set_follow(bool on) {
    if (follow_ == on) return;
    follow_ = on;
    if (auto at = boat_place(); on && at) {
        projection_.centre = *at;
        moved();
    }
    Q_EMIT follow_changed(on);
}

void chart_view::set_edit(bool on) {
    edit_ = on;
    if (on) set_measure(false);
    setCursor(on ? Qt::CrossCursor : Qt::ArrowCursor);
    update();
}

void chart_view::set_measure(bool on) {
    measure_ = on;
    measured_.clear();
    setCursor(on ? Qt::CrossCursor : Qt::ArrowCursor);
    update();
}

void chart_view::set_tail(double seconds) {
    tail_s_ = seconds;
    update();
}

void chart_view::fit() {
    std::vector<waypoint> all = draft_.points();
    if (seen_) all.insert(all.end(), seen_->mission.points.begin(), seen_->mission.points.end());
    if (auto at = boat_place()) all.push_back(*at);
    if (all.empty()) return;
    auto [south, north] =
        std::minmax_element(all.begin(), all.end(), [](auto& a, auto& b) { return a.latitude_deg < b.latitude_deg; });
    auto [west, east] =
        std::minmax_element(all.begin(), all.end(), [](auto& a, auto& b) { return a.longitude_deg < b.longitude_deg; });
    double low = south->latitude_deg, high = north->latitude_deg, left = west->longitude_deg,
           right = east->longitude_deg;
    projection_.centre = {(low + high) / 2, (left + right) / 2};
    double wide = distance_m({low, left}, {low, right}), tall = distance_m({low, left}, {high, left});
    double room_x = std::max(120.0, width() * 0.56), room_y = std::max(100.0, height() * 0.56);
    projection_.metres_per_pixel = std::clamp(std::max({wide / room_x, tall / room_y, 0.5}), chart_projection::closest,
                                              chart_projection::farthest);
    moved();
}

void chart_view::zoom(double factor) {
    auto at = follow_ && boat_place() ? projection_.to_pixels(*boat_place()) : QPointF(width() / 2.0, height() / 2.0);
    projection_.zoom(factor, at);
    moved();
}

void chart_view::place(const waypoint& centre, double metres_per_pixel) {
    placed_ = true;
    projection_.centre = centre;
    projection_.metres_per_pixel = std::clamp(metres_per_pixel, chart_projection::closest, chart_projection::farthest);
    moved();
}

void chart_view::resizeEvent(QResizeEvent*) {
    projection_.size = QSizeF(size());
    moved();
}

void chart_view::changeEvent(QEvent* event) {
    if (event->type() == QEvent::PaletteChange || event->type() == QEvent::StyleChange) moved();
    QWidget::changeEvent(event);
}

void chart_view::paintEvent(QPaintEvent*) {
    if (!base_valid_) paint_base();
    QPainter to(this);
    to.setRenderHint(QPainter::Antialiasing);
    to.drawPixmap(0, 0, base_);
    paint_track(to);
    paint_mission(to);
    if (draft_.edited() || edit_) paint_draft(to);
    paint_asked(to);
    paint_boat(to);
    paint_measure(to);
    paint_scale(to);
    paint_legend(to);
    paint_pointer(to);
    if (!boat_place()) paint_empty(to);
    QPainterPath corners;
    corners.addRect(rect());
    corners.addRoundedRect(QRectF(rect()).adjusted(0.5, 0.5, -0.5, -0.5), 9, 9);
    to.fillPath(corners, colours().page);
    to.setPen(QPen(hasFocus() ? colours().accent : colours().line, 1.2));
    to.setBrush(Qt::NoBrush);
    to.drawRoundedRect(QRectF(rect()).adjusted(0.6, 0.6, -0.6, -0.6), 9, 9);
}

} // namespace atirma::console
