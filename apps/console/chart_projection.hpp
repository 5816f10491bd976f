#pragma once
#include <components/boat/telemetry.hpp>

#include <QPointF>
#include <QSizeF>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace atirma::console {

/// Mercator between places and pixels.
class chart_projection {
public:
    static constexpr double metres_per_degree = 111319.49;  ///< of longitude on the equator
    static constexpr double closest = 0.02, farthest = 400; ///< metres a pixel

    waypoint centre{28.152, -15.452};
    double metres_per_pixel = 3;
    QSizeF size{600, 400};
    bool operator==(const chart_projection&) const = default;

    QPointF to_pixels(const waypoint& at) const {
        double scale = pixels_per_degree();
        return {size.width() / 2 + std::remainder(at.longitude_deg - centre.longitude_deg, 360) * scale,
                size.height() / 2 - (stretched(at.latitude_deg) - stretched(centre.latitude_deg)) * scale};
    }
    waypoint to_place(QPointF at) const {
        double scale = pixels_per_degree();
        waypoint made;
        made.longitude_deg = std::remainder(centre.longitude_deg + (at.x() - size.width() / 2) / scale, 360);
        made.latitude_deg = unstretched(stretched(centre.latitude_deg) - (at.y() - size.height() / 2) / scale);
        return made;
    }
    /// Zooms so that the place under `at` stays there; above 1 comes nearer.
    void zoom(double factor, QPointF at) {
        auto held = to_place(at);
        metres_per_pixel = std::clamp(metres_per_pixel / factor, closest, farthest);
        auto moved = to_pixels(held);
        pan(at - moved);
    }
    void pan(QPointF by) { centre = bounded(to_place(QPointF(size.width() / 2, size.height() / 2) - by)); }
    double pixels_per_degree() const {
        return metres_per_degree * std::cos(centre.latitude_deg * radians) / metres_per_pixel;
    }

private:
    static constexpr double radians = std::numbers::pi / 180;
    static double stretched(double latitude_deg) {
        return std::log(std::tan(std::numbers::pi / 4 + std::clamp(latitude_deg, -85.0, 85.0) * radians / 2)) / radians;
    }
    static double unstretched(double y) {
        return (2 * std::atan(std::exp(y * radians)) - std::numbers::pi / 2) / radians;
    }
    static waypoint bounded(waypoint at) {
        return {std::clamp(at.latitude_deg, -85.0, 85.0), std::remainder(at.longitude_deg, 360)};
    }
};

} // namespace atirma::console
