#include <components/coast/sea_limits.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace atirma {
namespace {

constexpr double metres_per_degree = 111'194.93;
constexpr double beside_m = 0.01; // what a place is beyond an edge to be on its other side

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

coast_point between(coast_point from, coast_point to, double part) {
    return {from.latitude_deg + part * (to.latitude_deg - from.latitude_deg),
            turn(from.longitude_deg + part * turn(to.longitude_deg - from.longitude_deg))};
}

/// From the origin to the line from a to b.
double distance_to(flat a, flat b) {
    flat edge{b.x - a.x, b.y - a.y};
    double squared = edge.x * edge.x + edge.y * edge.y;
    double part = squared > 0 ? std::clamp(-(a.x * edge.x + a.y * edge.y) / squared, 0.0, 1.0) : 0;
    return std::hypot(a.x + part * edge.x, a.y + part * edge.y);
}

/// The part of the leg from the origin where it crosses the line from a to b. A leg along it meets its neighbours.
std::optional<double> crossing(flat leg, flat a, flat b) {
    flat edge{b.x - a.x, b.y - a.y};
    double cross = leg.x * edge.y - leg.y * edge.x;
    if (cross == 0) return std::nullopt;
    double along = (a.x * edge.y - a.y * edge.x) / cross;
    double across = (a.x * leg.y - a.y * leg.x) / cross;
    if (along < 0 || along > 1 || across < 0 || across > 1) return std::nullopt;
    return along;
}

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
        keeps_in_ = keeps_in_ || !each.keep_out;
        areas_.push_back(std::move(made));
    }
    find_fence_limits();
}

std::shared_ptr<const sea_limits> sea_limits::coast_only() {
    static const auto made = std::make_shared<const sea_limits>();
    return made;
}

bool sea_limits::box::meets(const box& other) const noexcept {
    if (north < other.south || south > other.north) return false;
    double apart = std::abs(middle - other.middle);
    return std::min(apart, 360 - apart) <= half + other.half; // the shorter way round
}

/// A little more than what a leg covers.
sea_limits::box sea_limits::box_of(coast_point from, coast_point to) {
    constexpr double margin_deg = 1e-6;
    return {std::min(from.latitude_deg, to.latitude_deg) - margin_deg,
            std::max(from.latitude_deg, to.latitude_deg) + margin_deg, between(from, to, 0.5).longitude_deg,
            std::abs(turn(to.longitude_deg - from.longitude_deg)) / 2 + margin_deg};
}

sea_limits::ring sea_limits::make_ring(std::vector<coast_point> points) {
    ring made{std::move(points), {}, 0, {90, -90, 0, 0}};
    double east = 0, least = 0, most = 0;
    for (const auto& each : made.points) {
        made.around.south = std::min(made.around.south, each.latitude_deg);
        made.around.north = std::max(made.around.north, each.latitude_deg);
        if (!made.east.empty()) east += turn(each.longitude_deg - made.points[made.east.size() - 1].longitude_deg);
        made.east.push_back(east);
        least = std::min(least, east);
        most = std::max(most, east);
    }
    made.middle = (least + most) / 2;
    made.around.middle = turn(made.points.front().longitude_deg + made.middle);
    made.around.half = (most - least) / 2;
    return made;
}

sea_limits::box sea_limits::box_of(coast_point at) {
    return {at.latitude_deg, at.latitude_deg, turn(at.longitude_deg), 1e-9};
}

bool sea_limits::inside(const std::vector<ring>& rings, coast_point at, const box& here) {
    bool in = false; // even-odd: a hole is outside again
    for (const auto& one : rings) {
        if (!one.around.meets(here)) continue;
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
        if (one.around.north < south || one.around.south > north) continue;
        for (std::size_t i = 0; i + 1 < one.points.size(); ++i) {
            const auto &p = one.points[i], &q = one.points[i + 1];
            if (std::max(p.latitude_deg, q.latitude_deg) < south || std::min(p.latitude_deg, q.latitude_deg) > north)
                continue;
            auto along = crossing(leg, on.of(p), on.of(q));
            if (along && (!first || *along < *first)) first = along;
        }
    }
    return first;
}

double sea_limits::distance_m(const std::vector<ring>& rings, coast_point at, double at_most_m) {
    double nearest = at_most_m, reach_deg = at_most_m / metres_per_degree;
    plane on(at);
    for (const auto& one : rings) {
        if (one.around.north < at.latitude_deg - reach_deg || one.around.south > at.latitude_deg + reach_deg) continue;
        for (std::size_t i = 0; i + 1 < one.points.size(); ++i) {
            const auto &p = one.points[i], &q = one.points[i + 1];
            if (std::max(p.latitude_deg, q.latitude_deg) < at.latitude_deg - reach_deg ||
                std::min(p.latitude_deg, q.latitude_deg) > at.latitude_deg + reach_deg)
                continue;
            nearest = std::min(nearest, distance_to(on.of(p), on.of(q)));
        }
    }
    return nearest;
}

/// Whether an edge comes near the box of another area.
bool sea_limits::meets_other(const area& mine, coast_point from, coast_point to) const {
    auto here = box_of(from, to);
    return std::any_of(areas_.begin(), areas_.end(), [&](const area& other) {
        return &other != &mine && std::any_of(other.rings.begin(), other.rings.end(),
                                              [&](const ring& one) { return one.around.meets(here); });
    });
}

/// Where an edge meets those of other areas, 0 and 1 included, in order.
std::vector<double> sea_limits::parts_of(const area& mine, coast_point from, coast_point to) const {
    std::vector<double> parts{0, 1};
    plane on(from);
    auto whole = on.of(to);
    double squared = whole.x * whole.x + whole.y * whole.y;
    auto here = box_of(from, to);
    for (const auto& other : areas_) {
        if (&other == &mine) continue;
        for (const auto& one : other.rings) {
            if (!one.around.meets(here)) continue;
            for (std::size_t i = 0; i + 1 < one.points.size(); ++i) {
                const auto &p = one.points[i], &q = one.points[i + 1];
                if (std::max(p.latitude_deg, q.latitude_deg) < here.south ||
                    std::min(p.latitude_deg, q.latitude_deg) > here.north || !here.meets(box_of(p, q)))
                    continue;
                auto a = on.of(p), b = on.of(q);
                if (auto along = crossing(whole, a, b)) parts.push_back(*along);
                // An edge along this one ends here. Where it is elsewhere, the cut does no harm.
                double end = squared > 0 ? (a.x * whole.x + a.y * whole.y) / squared : 0;
                if (end > 0 && end < 1 && std::hypot(a.x - end * whole.x, a.y - end * whole.y) < beside_m)
                    parts.push_back(end);
            }
        }
    }
    std::sort(parts.begin(), parts.end());
    return parts;
}

/// An edge that two areas share, or that lies inside another area, is not a limit.
void sea_limits::find_fence_limits() {
    auto is_limit = [this](coast_point from, coast_point to) {
        auto middle = between(from, to, 0.5);
        auto ahead = plane(middle).of(to);
        double length = std::hypot(ahead.x, ahead.y);
        if (length == 0) return false;
        double course_deg = std::atan2(ahead.x, ahead.y) * 180 / std::numbers::pi;
        return within_fence(flat_destination(middle, course_deg + 90, beside_m)) !=
               within_fence(flat_destination(middle, course_deg - 90, beside_m));
    };
    for (const auto& each : areas_)
        for (const auto& one : each.rings)
            for (std::size_t i = 0; i + 1 < one.points.size(); ++i) {
                const auto &from = one.points[i], &to = one.points[i + 1];
                if (!meets_other(each, from, to)) {
                    // One to keep out counts nothing where the boat may not be anyway.
                    if (!each.keep_out || !keeps_in_) fence_limits_.push_back({from, to});
                    continue;
                }
                auto parts = parts_of(each, from, to);
                for (std::size_t k = 0; k + 1 < parts.size(); ++k) {
                    auto begin = between(from, to, parts[k]), end = between(from, to, parts[k + 1]);
                    if (is_limit(begin, end)) fence_limits_.push_back({begin, end});
                }
            }
}

bool sea_limits::on_land(coast_point at) const { return inside(land_, at, box_of(at)); }

bool sea_limits::within_fence(coast_point at) const {
    bool in_one = false;
    auto here = box_of(at);
    for (const auto& each : areas_) {
        bool in = inside(each.rings, at, here);
        if (each.keep_out && in) return false;
        in_one = in_one || in;
    }
    return in_one || !keeps_in_;
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

/// Where a leg leaves what the fence allows. Between two crossings of an area's edges nothing changes, so one place in
/// each part decides.
std::optional<std::string> sea_limits::fence_trouble(coast_point from, coast_point to) const {
    if (areas_.empty()) return std::nullopt;
    double length_m = flat_distance_m(from, to);
    if (!within_fence(to)) return "ends outside the fence";
    if (!within_fence(from)) return std::nullopt; // it leads back
    struct change {                               // of the number of areas around the boat
        double at;
        int keep_in, keep_out;
    };
    std::vector<change> changes{{0, 0, 0}, {1, 0, 0}};
    std::vector<double> crossings;
    plane on(from);
    auto leg = on.of(to);
    auto whole = box_of(from, to);
    for (const auto& each : areas_) {
        crossings.assign({0, 1});
        bool met = false;
        for (const auto& one : each.rings) {
            if (!one.around.meets(whole)) continue;
            met = true;
            for (std::size_t i = 0; i + 1 < one.points.size(); ++i)
                if (auto along = crossing(leg, on.of(one.points[i]), on.of(one.points[i + 1])))
                    crossings.push_back(*along);
        }
        if (!met) continue;
        std::sort(crossings.begin(), crossings.end());
        for (std::size_t i = 0; i + 1 < crossings.size(); ++i) {
            auto middle = between(from, to, (crossings[i] + crossings[i + 1]) / 2);
            if (crossings[i] == crossings[i + 1] || !inside(each.rings, middle, box_of(middle))) continue;
            changes.push_back({crossings[i], each.keep_out ? 0 : 1, each.keep_out ? 1 : 0});
            changes.push_back({crossings[i + 1], each.keep_out ? 0 : -1, each.keep_out ? -1 : 0});
        }
    }
    std::sort(changes.begin(), changes.end(), [](const change& a, const change& b) { return a.at < b.at; });
    double shortest = beside_m / std::max(length_m, beside_m); // between two that are one
    int keep_in = 0, keep_out = 0;
    for (std::size_t i = 0; i + 1 < changes.size(); ++i) {
        keep_in += changes[i].keep_in;
        keep_out += changes[i].keep_out;
        bool allowed = keep_out == 0 && (keep_in > 0 || !keeps_in_);
        if (!allowed && changes[i + 1].at - changes[i].at >= shortest)
            return fmt::format("leaves the fence after {}", metres_text(changes[i].at * length_m));
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
    double nearest = at_most_m, reach_deg = at_most_m / metres_per_degree;
    plane on(at);
    for (const auto& each : fence_limits_) {
        if (std::max(each.from.latitude_deg, each.to.latitude_deg) < at.latitude_deg - reach_deg ||
            std::min(each.from.latitude_deg, each.to.latitude_deg) > at.latitude_deg + reach_deg)
            continue;
        nearest = std::min(nearest, distance_to(on.of(each.from), on.of(each.to)));
    }
    return within_fence(at) ? nearest : -nearest;
}

double sea_limits::clearance_m(coast_point at, double at_most_m) const {
    double land = distance_m(land_, at, at_most_m);
    if (on_land(at)) land = -land;
    return std::min(land, fence_clearance_m(at, at_most_m));
}

} // namespace atirma
