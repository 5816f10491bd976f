#include <components/coast/sea_limits.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace atirma {
namespace {

constexpr double metres_per_degree = 111'194.93;

double radians(double degrees) { return degrees * std::numbers::pi / 180; }
/// The shorter way round, so that an area over the antimeridian is one.
double turn(double degrees) { return std::remainder(degrees, 360.0); }

/// Metres east and north of a place.
struct flat {
    double x, y;
};
class plane {
public:
    explicit plane(coast_point origin) : origin_(origin), narrow_(std::cos(radians(origin.latitude_deg))) {}
    flat of(coast_point at) const {
        return {turn(at.longitude_deg - origin_.longitude_deg) * metres_per_degree * narrow_,
                (at.latitude_deg - origin_.latitude_deg) * metres_per_degree};
    }

private:
    coast_point origin_;
    double narrow_;
};

std::string metres_text(double metres) {
    return metres < 1000 ? fmt::format("{:.0f} m", metres) : fmt::format("{:.1f} km", metres / 1000);
}

} // namespace

double flat_distance_m(coast_point a, coast_point b) noexcept {
    auto there = plane(a).of(b);
    return std::hypot(there.x, there.y);
}

coast_point flat_destination(coast_point from, double course_deg, double metres) noexcept {
    double narrow = std::max(1e-6, std::cos(radians(from.latitude_deg)));
    return {from.latitude_deg + metres * std::cos(radians(course_deg)) / metres_per_degree,
            turn(from.longitude_deg + metres * std::sin(radians(course_deg)) / metres_per_degree / narrow)};
}

sea_limits::sea_limits(geofence fence, bool land) : fence_(std::move(fence)) {
    if (land)
        for (const auto& each : coast_rings()) land_.push_back(make_ring(each.points));
    for (const auto& each : fence_.areas()) {
        area made{{}, each.keep_out, each.name};
        for (const auto& points : each.rings) made.rings.push_back(make_ring(points));
        areas_.push_back(std::move(made));
    }
}

std::shared_ptr<const sea_limits> sea_limits::coast_only() {
    static const auto made = std::make_shared<const sea_limits>();
    return made;
}

sea_limits::ring sea_limits::make_ring(std::vector<coast_point> points) {
    ring made{std::move(points), {}, 90, -90, 0};
    double east = 0, least = 0, most = 0;
    for (const auto& each : made.points) {
        made.south = std::min(made.south, each.latitude_deg);
        made.north = std::max(made.north, each.latitude_deg);
        if (!made.east.empty()) east += turn(each.longitude_deg - made.points[made.east.size() - 1].longitude_deg);
        made.east.push_back(east);
        least = std::min(least, east);
        most = std::max(most, east);
    }
    made.middle = (least + most) / 2;
    return made;
}

bool sea_limits::inside(const std::vector<ring>& rings, coast_point at) {
    bool in = false; // even-odd: a hole is outside again
    for (const auto& one : rings) {
        if (at.latitude_deg < one.south || at.latitude_deg > one.north) continue;
        double x = one.middle + turn(at.longitude_deg - one.points.front().longitude_deg - one.middle);
        for (std::size_t i = 0; i + 1 < one.points.size(); ++i) {
            const auto &a = one.points[i], &b = one.points[i + 1];
            if ((a.latitude_deg > at.latitude_deg) == (b.latitude_deg > at.latitude_deg)) continue;
            double part = (at.latitude_deg - a.latitude_deg) / (b.latitude_deg - a.latitude_deg);
            if (one.east[i] + part * (one.east[i + 1] - one.east[i]) > x) in = !in;
        }
    }
    return in;
}

/// The part of the leg before the first edge that it meets.
std::optional<double> sea_limits::first_crossing(const std::vector<ring>& rings, coast_point from, coast_point to) {
    std::optional<double> first;
    plane on(from);
    auto leg = on.of(to);
    double south = std::min(from.latitude_deg, to.latitude_deg), north = std::max(from.latitude_deg, to.latitude_deg);
    for (const auto& one : rings) {
        if (one.north < south || one.south > north) continue;
        for (std::size_t i = 0; i + 1 < one.points.size(); ++i) {
            const auto &p = one.points[i], &q = one.points[i + 1];
            if (std::max(p.latitude_deg, q.latitude_deg) < south || std::min(p.latitude_deg, q.latitude_deg) > north)
                continue;
            auto a = on.of(p), b = on.of(q);
            flat edge{b.x - a.x, b.y - a.y};
            double cross = leg.x * edge.y - leg.y * edge.x;
            if (cross == 0) continue; // along the edge: its neighbours are met
            double along = (a.x * edge.y - a.y * edge.x) / cross;
            double across = (a.x * leg.y - a.y * leg.x) / cross;
            if (along < 0 || along > 1 || across < 0 || across > 1) continue;
            if (!first || along < *first) first = along;
        }
    }
    return first;
}

double sea_limits::distance_m(const std::vector<ring>& rings, coast_point at, double at_most_m) {
    double nearest = at_most_m, reach_deg = at_most_m / metres_per_degree;
    plane on(at);
    for (const auto& one : rings) {
        if (one.north < at.latitude_deg - reach_deg || one.south > at.latitude_deg + reach_deg) continue;
        for (std::size_t i = 0; i + 1 < one.points.size(); ++i) {
            const auto &p = one.points[i], &q = one.points[i + 1];
            if (std::max(p.latitude_deg, q.latitude_deg) < at.latitude_deg - reach_deg ||
                std::min(p.latitude_deg, q.latitude_deg) > at.latitude_deg + reach_deg)
                continue;
            auto a = on.of(p), b = on.of(q);
            flat edge{b.x - a.x, b.y - a.y};
            double squared = edge.x * edge.x + edge.y * edge.y;
            double part = squared > 0 ? std::clamp(-(a.x * edge.x + a.y * edge.y) / squared, 0.0, 1.0) : 0;
            nearest = std::min(nearest, std::hypot(a.x + part * edge.x, a.y + part * edge.y));
        }
    }
    return nearest;
}

bool sea_limits::on_land(coast_point at) const { return inside(land_, at); }

bool sea_limits::within_fence(coast_point at) const {
    bool kept_in = false, in_one = false;
    for (const auto& each : areas_) {
        bool in = inside(each.rings, at);
        if (each.keep_out && in) return false;
        kept_in = kept_in || !each.keep_out;
        in_one = in_one || (!each.keep_out && in);
    }
    return in_one || !kept_in;
}

std::optional<double> sea_limits::metres_to_land(coast_point from, coast_point to) const {
    if (on_land(from)) return 0;
    auto part = first_crossing(land_, from, to);
    if (!part) return std::nullopt;
    return *part * flat_distance_m(from, to);
}

std::optional<std::string> sea_limits::trouble(coast_point at) const {
    if (on_land(at)) return "is on land";
    if (!within_fence(at)) return "is outside the fence";
    return std::nullopt;
}

/// Where a leg leaves what the fence allows. Between two crossings of edges nothing changes, so one place in each part
/// decides.
std::optional<std::string> sea_limits::fence_trouble(coast_point from, coast_point to) const {
    if (areas_.empty()) return std::nullopt;
    double length_m = flat_distance_m(from, to);
    if (!within_fence(to)) return "ends outside the fence";
    if (!within_fence(from)) return std::nullopt; // it leads back
    auto place = [&](double part) {
        return coast_point{from.latitude_deg + part * (to.latitude_deg - from.latitude_deg),
                           turn(from.longitude_deg + part * turn(to.longitude_deg - from.longitude_deg))};
    };
    double done = 0, step = std::min(1.0, 0.01 / std::max(length_m, 0.01)); // a centimetre beyond an edge
    while (done < 1) {
        double first = 1;
        for (const auto& each : areas_)
            if (auto part = first_crossing(each.rings, place(done), to))
                first = std::min(first, done + *part * (1 - done));
        double beyond = std::min(1.0, first + step);
        if (!within_fence(place(beyond)))
            return fmt::format("leaves the fence after {}", metres_text(first * length_m));
        done = beyond;
    }
    return std::nullopt;
}

std::optional<std::string> sea_limits::trouble(coast_point from, coast_point to) const {
    double length_m = flat_distance_m(from, to);
    if (on_land(to)) return "ends on land";
    if (on_land(from)) return "starts on land";
    if (auto part = first_crossing(land_, from, to))
        return fmt::format("crosses land after {}", metres_text(*part * length_m));
    return fence_trouble(from, to);
}

double sea_limits::fence_clearance_m(coast_point at, double at_most_m) const {
    if (areas_.empty()) return at_most_m;
    double nearest = at_most_m;
    for (const auto& each : areas_) nearest = distance_m(each.rings, at, nearest);
    return within_fence(at) ? nearest : -nearest;
}

double sea_limits::clearance_m(coast_point at, double at_most_m) const {
    double land = distance_m(land_, at, at_most_m);
    if (on_land(at)) land = -land;
    return std::min(land, fence_clearance_m(at, at_most_m));
}

} // namespace atirma
