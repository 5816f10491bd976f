#include "waypoint_editor.hpp"

#include "chart_layers.hpp"
#include "theme.hpp"

#include <QPainter>

#include <cmath>
#include <utility>

namespace atirma::console {

std::optional<std::size_t> waypoint_editor::waypoint_at(QPointF pixel) const {
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

bool waypoint_editor::select(QPointF pixel) {
    auto hit = waypoint_at(pixel);
    if (hit) draft_.select(static_cast<int>(*hit));
    return hit.has_value();
}

void waypoint_editor::grab(QPointF pixel) {
    moved_ = false;
    held_ = waypoint_at(pixel);
    if (held_) draft_.select(static_cast<int>(*held_));
}

bool waypoint_editor::remove(QPointF pixel) {
    auto hit = waypoint_at(pixel);
    if (hit) draft_.remove(*hit);
    return hit.has_value();
}

void waypoint_editor::drag(QPointF pixel) {
    if (!std::exchange(moved_, true)) draft_.begin_drag();
    draft_.drag(*held_, projection_.to_place(pixel));
}

bool waypoint_editor::insert(const waypoint& place) {
    auto before = draft_.selected() >= 0 ? static_cast<std::size_t>(draft_.selected()) + 1 : draft_.points().size();
    return draft_.insert(before, place);
}

bool waypoint_editor::remove_selected() {
    if (!on_ || draft_.selected() < 0) return false;
    draft_.remove(static_cast<std::size_t>(draft_.selected()));
    return true;
}

void waypoint_editor::paint(QPainter& to) const {
    if (!draft_.edited() && !on_) return;
    const auto& t = colours();
    auto line = paint_route(to, projection_, draft_.points(), QPen(t.draft, 1.8, Qt::DashLine));
    for (int i = 0; i < line.size(); ++i) {
        bool chosen = i == draft_.selected();
        if (chosen) {
            QColor ring = t.draft;
            ring.setAlpha(70);
            to.setPen(Qt::NoPen);
            to.setBrush(ring);
            to.drawEllipse(line[i], 17, 17);
        }
        paint_waypoint(to, line[i], i + 1,
                       waypoint_look{chosen ? t.draft : t.card, t.draft, chosen ? t.card : t.draft, 10});
    }
}

} // namespace atirma::console
