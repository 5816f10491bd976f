#include "chart_view.hpp"

#include "theme.hpp"

#include <components/gui_client/mission.hpp>

#include <QKeyEvent>
#include <QMouseEvent>
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

std::optional<std::size_t> chart_view::waypoint_at(QPointF pixel) const {
    std::optional<std::size_t> nearest;
    double best = 14;
    for (std::size_t i = 0; i < draft_.points().size(); ++i) {
        auto away = projection_.to_pixels(draft_.points()[i]) - pixel;
        double length = std::hypot(away.x(), away.y());
        if (length > best) continue;
        best = length;
        nearest = i;
    }
    return nearest;
}

void chart_view::mousePressEvent(QMouseEvent* event) {
    setFocus();
    pressed_at_ = last_mouse_ = event->position();
    panned_ = false;
    dragged_.reset();
    if (!edit_) return;
    auto hit = waypoint_at(event->position());
    if (!hit) return;
    if (event->button() == Qt::RightButton) {
        pressed_at_.reset();
        draft_.remove(*hit);
        return;
    }
    draft_.select(static_cast<int>(*hit));
    dragged_ = hit;
}

void chart_view::mouseMoveEvent(QMouseEvent* event) {
    pointer_ = event->position();
    update();
    if (!pressed_at_ || !(event->buttons() & Qt::LeftButton)) return;
    auto by = event->position() - *last_mouse_;
    bool far = (event->position() - *pressed_at_).manhattanLength() > 4;
    if (!far && !panned_) return;
    if (dragged_) {
        if (!panned_) draft_.begin_drag();
        draft_.drag(*dragged_, projection_.to_place(event->position()));
    } else {
        if (follow_) set_follow(false);
        projection_.pan(by);
        moved();
    }
    panned_ = true;
    last_mouse_ = event->position();
}

void chart_view::mouseReleaseEvent(QMouseEvent* event) {
    bool click = pressed_at_ && !panned_ && event->button() == Qt::LeftButton;
    pressed_at_.reset();
    if (std::exchange(dragged_, std::nullopt)) return;
    if (!click) return;
    auto place = projection_.to_place(event->position());
    if (measure_) {
        measured_.push_back(place);
        update();
    } else if (edit_) {
        auto before = draft_.selected() >= 0 ? static_cast<std::size_t>(draft_.selected()) + 1 : draft_.points().size();
        if (!draft_.insert(before, place))
            Q_EMIT edit_refused(tr("A boat takes %1 waypoints at most.").arg(mission_draft::most));
    } else if (auto hit = waypoint_at(event->position())) {
        draft_.select(static_cast<int>(*hit));
    }
}

void chart_view::mouseDoubleClickEvent(QMouseEvent* event) {
    if (edit_ || measure_) return mousePressEvent(event);
    if (follow_) set_follow(false);
    projection_.zoom(2, event->position());
    moved();
}

void chart_view::wheelEvent(QWheelEvent* event) {
    double steps = event->angleDelta().y() / 120.0;
    auto at = follow_ && boat_place() ? projection_.to_pixels(*boat_place()) : event->position();
    projection_.zoom(std::pow(1.25, steps), at);
    moved();
    event->accept();
}

void chart_view::keyPressEvent(QKeyEvent* event) {
    auto pan = [this](double x, double y) {
        if (follow_) set_follow(false);
        projection_.pan({x, y});
        moved();
    };
    switch (event->key()) {
        case Qt::Key_Left: return pan(60, 0);
        case Qt::Key_Right: return pan(-60, 0);
        case Qt::Key_Up: return pan(0, 60);
        case Qt::Key_Down: return pan(0, -60);
        case Qt::Key_Delete:
        case Qt::Key_Backspace:
            if (edit_ && draft_.selected() >= 0) return draft_.remove(static_cast<std::size_t>(draft_.selected()));
            if (measure_ && !measured_.empty()) {
                measured_.pop_back();
                return update();
            }
            break;
        case Qt::Key_Escape:
            if (measure_) return set_measure(false);
            draft_.select(-1);
            break;
        default: break;
    }
    QWidget::keyPressEvent(event);
}

void chart_view::leaveEvent(QEvent*) {
    pointer_.reset();
    update();
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
