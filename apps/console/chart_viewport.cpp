#include "chart_viewport.hpp"

#include <components/gui_client/mission.hpp>

#include <QRectF>

#include <algorithm>
#include <cmath>

namespace atirma::console {

void chart_viewport::keep_in_sight(const waypoint& boat) {
    if (placed_ && !follow_) return;
    double width = projection.size.width(), height = projection.size.height();
    QRectF middle(width * 0.12, height * 0.12, width * 0.76, height * 0.76);
    if (!placed_ || !middle.contains(projection.to_pixels(boat))) projection.centre = boat;
}

void chart_viewport::fit(const std::vector<waypoint>& places) {
    if (places.empty()) return;
    auto [south, north] = std::minmax_element(places.begin(), places.end(),
                                              [](auto& a, auto& b) { return a.latitude_deg < b.latitude_deg; });
    double low = south->latitude_deg, high = north->latitude_deg;
    // From the first one the short way round: places on both sides of 180° are neighbours.
    double first = places.front().longitude_deg, left = first, right = first;
    for (const auto& one : places) {
        double at = first + std::remainder(one.longitude_deg - first, 360);
        left = std::min(left, at);
        right = std::max(right, at);
    }
    projection.centre = {(low + high) / 2, std::remainder((left + right) / 2, 360)};
    double wide = distance_m({low, left}, {low, right}), tall = distance_m({low, left}, {high, left});
    double room_x = std::max(120.0, projection.size.width() * 0.56);
    double room_y = std::max(100.0, projection.size.height() * 0.56);
    set_scale(std::max({wide / room_x, tall / room_y, 0.5}));
}

void chart_viewport::zoom(double factor, QPointF at, const std::optional<waypoint>& boat) {
    projection.zoom(factor, follow_ && boat ? projection.to_pixels(*boat) : at);
}

void chart_viewport::place(const waypoint& centre, double metres_per_pixel) {
    placed_ = true;
    projection.centre = centre;
    set_scale(metres_per_pixel);
}

void chart_viewport::set_scale(double metres_per_pixel) {
    projection.metres_per_pixel = std::clamp(metres_per_pixel, chart_projection::closest, chart_projection::farthest);
}

} // namespace atirma::console
