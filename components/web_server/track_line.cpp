#include <components/web_server/track_line.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

namespace atirma {

namespace {
constexpr double mean_earth_radius_m = 6'371'008.8;
constexpr double radians_per_degree = std::numbers::pi / 180;

double between(const track_point& a, const track_point& b) noexcept {
    return distance_m(a.latitude_deg, a.longitude_deg, b.latitude_deg, b.longitude_deg);
}

/// How much is lost without `b`: its distance from where the boat would seem to be at that moment, and the time gap.
double weight_of(const track_point& a, const track_point& b, const track_point& c) noexcept {
    auto whole = static_cast<double>((c.at - a.at).count());
    double part = whole > 0 ? static_cast<double>((b.at - a.at).count()) / whole : 0;
    double latitude = a.latitude_deg + part * (c.latitude_deg - a.latitude_deg);
    double longitude = a.longitude_deg + part * (c.longitude_deg - a.longitude_deg);
    constexpr double metres_per_gap_second = 0.05;
    return distance_m(latitude, longitude, b.latitude_deg, b.longitude_deg) + metres_per_gap_second * whole / 1000;
}

bool earlier(const track_point& point, utc_ms at) noexcept { return point.at < at; }
} // namespace

double distance_m(double lat1, double lon1, double lat2, double lon2) noexcept {
    double dlat = (lat2 - lat1) * radians_per_degree, dlon = (lon2 - lon1) * radians_per_degree;
    double a = std::pow(std::sin(dlat / 2), 2) + std::cos(lat1 * radians_per_degree) *
                                                     std::cos(lat2 * radians_per_degree) *
                                                     std::pow(std::sin(dlon / 2), 2);
    return 2 * mean_earth_radius_m * std::asin(std::sqrt(std::min(1.0, a)));
}

double bearing_deg(double lat1, double lon1, double lat2, double lon2) noexcept {
    double a = lat1 * radians_per_degree, b = lat2 * radians_per_degree, dlon = (lon2 - lon1) * radians_per_degree;
    double angle = std::atan2(std::sin(dlon) * std::cos(b),
                              std::cos(a) * std::sin(b) - std::sin(a) * std::cos(b) * std::cos(dlon));
    double degrees = std::fmod(angle / radians_per_degree + 360, 360);
    return degrees < 360 ? degrees : 0;
}

const track_point* track_line::before(utc_ms at) const noexcept {
    auto after =
        std::upper_bound(points_.begin(), points_.end(), at, [](utc_ms t, const track_point& p) { return t < p.at; });
    return after == points_.begin() ? nullptr : &*std::prev(after);
}

void track_line::append(track_point point) {
    bool rough = point.circular_error_m.value_or(0) > limits_.rough_fix_m;
    point.sailed_m = sailed_m();
    if (!points_.empty()) point.silence = point.at - points_.back().at;
    if (!rough) {
        double moved = counted_from_ ? between(*counted_from_, point) : 0;
        if (!counted_from_ || moved >= limits_.noise_m) {
            point.sailed_m += moved;
            counted_from_ = point;
        }
    }
    points_.push_back(point);
}

const track_point* track_line::insert(track_point point) {
    const auto at = point.at;
    auto next = std::lower_bound(points_.begin(), points_.end(), at, earlier);
    if (next != points_.end() && next->at - point.at < limits_.spacing) return nullptr;
    if (next != points_.begin() && point.at - std::prev(next)->at < limits_.spacing) return nullptr;
    if (next == points_.end()) {
        append(std::move(point));
    } else {
        // A late fix makes the way longer for all that follow by the detour through it.
        double detour = 0;
        bool rough = point.circular_error_m.value_or(0) > limits_.rough_fix_m;
        if (next == points_.begin()) {
            if (!rough) detour = between(point, *next);
            next->silence = next->at - point.at;
        } else {
            const auto& previous = *std::prev(next);
            point.sailed_m = previous.sailed_m;
            point.silence = std::min(next->silence, point.at - previous.at);
            next->silence = std::min(next->silence, next->at - point.at);
            if (!rough) {
                point.sailed_m += between(previous, point);
                detour = std::max(0.0, point.sailed_m + between(point, *next) - next->sailed_m);
            }
        }
        if (detour < limits_.noise_m) detour = 0;
        next = points_.insert(next, std::move(point));
        for (auto after = std::next(next); after != points_.end(); ++after) after->sailed_m += detour;
        next->sailed_m = std::min(next->sailed_m, std::next(next)->sailed_m);
    }
    if (points_.size() > limits_.max_points) thin();
    auto kept = std::lower_bound(points_.begin(), points_.end(), at, earlier);
    return kept != points_.end() && kept->at == at ? &*kept : nullptr;
}

const track_point* track_line::annotate_wind(utc_ms at, double speed_mps, std::optional<double> direction_deg,
                                             std::uint64_t revision, std::chrono::milliseconds tolerance) {
    auto best = std::lower_bound(points_.begin(), points_.end(), at, earlier);
    if (best == points_.end() || (best != points_.begin() && at - std::prev(best)->at < best->at - at)) {
        if (best == points_.begin()) return nullptr;
        --best;
    }
    auto apart = best->at > at ? best->at - at : at - best->at;
    if (apart > tolerance || best->wind_speed_mps) return nullptr;
    best->wind_speed_mps = speed_mps;
    best->wind_direction_deg = direction_deg;
    best->revision = revision;
    return &*best;
}

void track_line::correct_sailed(double total_m) noexcept {
    double missing = total_m - sailed_m();
    if (points_.size() < 2 || !(missing > 0)) return;
    for (auto point = std::next(points_.begin()); point != points_.end(); ++point) point->sailed_m += missing;
}

void track_line::thin() {
    std::size_t old = points_.size() * 3 / 4;
    if (old < 8) { // a tiny limit: the oldest go
        auto surplus = points_.size() - std::min(points_.size(), limits_.max_points);
        points_.erase(points_.begin(), points_.begin() + static_cast<std::ptrdiff_t>(surplus));
        thinned_ += surplus;
        return;
    }
    std::vector<double> weights(old, 0);
    for (std::size_t i = 1; i + 1 < old; ++i) weights[i] = weight_of(points_[i - 1], points_[i], points_[i + 1]);
    auto sorted = std::vector<double>(weights.begin() + 1, weights.end() - 1);
    auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
    std::nth_element(sorted.begin(), middle, sorted.end());
    double limit = *middle;
    // No two neighbours go at once: their weights suppose that the other stays.
    std::vector<track_point> kept;
    kept.reserve(points_.size());
    bool last_went = true; // the first point stays
    std::chrono::milliseconds silence{0};
    for (std::size_t i = 0; i < points_.size(); ++i) {
        last_went = !last_went && i + 1 < old && weights[i] <= limit;
        silence = std::max(silence, points_[i].silence);
        if (last_went) continue;
        kept.push_back(points_[i]);
        kept.back().silence = std::exchange(silence, std::chrono::milliseconds(0));
    }
    thinned_ += points_.size() - kept.size();
    points_ = std::move(kept);
}

} // namespace atirma
