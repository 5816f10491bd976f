#pragma once
#include <components/boat/telemetry.hpp>

#include <cmath>
#include <numbers>

namespace atirma::simulator {

inline constexpr double pi = std::numbers::pi;

/// Metres east (x) and north (y) of an origin.
struct vec {
    double x = 0;
    double y = 0;
    bool operator==(const vec&) const = default;
};
constexpr vec operator+(vec a, vec b) { return {a.x + b.x, a.y + b.y}; }
constexpr vec operator-(vec a, vec b) { return {a.x - b.x, a.y - b.y}; }
constexpr vec operator*(double k, vec a) { return {k * a.x, k * a.y}; }
constexpr double dot(vec a, vec b) { return a.x * b.x + a.y * b.y; }
constexpr double det(vec a, vec b) { return a.x * b.y - a.y * b.x; }
inline double length(vec a) { return std::hypot(a.x, a.y); }
/// Mathematical angle: counter-clockwise from east.
inline double angle_rad(vec a) { return std::atan2(a.y, a.x); }

constexpr double radians(double degrees) { return degrees * pi / 180; }
constexpr double degrees(double radians) { return radians * 180 / pi; }
/// Into -π … π.
inline double wrap_rad(double angle) { return std::remainder(angle, 2 * pi); }
/// Into 0 <= x < 360.
inline double wrap_deg(double angle) {
    double wrapped = std::fmod(angle, 360.0);
    if (wrapped < 0) wrapped += 360;
    return wrapped >= 360 ? 0 : wrapped;
}
/// Mathematical angle to compass direction and back.
inline double compass_deg(double angle) { return wrap_deg(90 - degrees(angle)); }
inline double from_compass_rad(double direction_deg) { return wrap_rad(radians(90 - direction_deg)); }

/// Places on the chart as metres around an origin, on the local tangent plane of a sphere: good to a few metres in 20
/// km.
class local_chart {
public:
    explicit local_chart(waypoint origin) : origin_(origin), cos_latitude_(std::cos(radians(origin.latitude_deg))) {}
    vec to_metres(waypoint p) const {
        return {radians(std::remainder(p.longitude_deg - origin_.longitude_deg, 360)) * earth_radius_m * cos_latitude_,
                radians(p.latitude_deg - origin_.latitude_deg) * earth_radius_m};
    }
    waypoint to_waypoint(vec v) const {
        return {origin_.latitude_deg + degrees(v.y / earth_radius_m),
                std::remainder(origin_.longitude_deg + degrees(v.x / (earth_radius_m * cos_latitude_)), 360)};
    }
    waypoint origin() const { return origin_; }

private:
    static constexpr double earth_radius_m = 6371008.8;
    waypoint origin_;
    double cos_latitude_;
};

} // namespace atirma::simulator
