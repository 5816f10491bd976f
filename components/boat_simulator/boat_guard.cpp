#include <components/boat_simulator/boat_guard.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace atirma::simulator {
namespace {

constexpr double look_m = 1000; // limits farther away do not matter yet
constexpr double free_at_most_m = 100;
constexpr double look_every_s = 1; // near a limit
constexpr double ahead_s = 20;     // whether it gets nearer
constexpr double refuge_reach_m = 5000;

coast_point of(const waypoint& at) { return {at.latitude_deg, at.longitude_deg}; }
waypoint of(coast_point at) { return {at.latitude_deg, at.longitude_deg}; }

} // namespace

std::optional<boat_guard::order> boat_guard::update(const guarded_state& now) {
    if (now.remote_control) { // its time is not that of a mode, and the limits count again when it ends
        mode_since_s_ = now.now_s;
        looked_at_.reset();
        return std::nullopt;
    }
    if (auto turn = watch_limits(now)) return turn;
    return watch_heading(now);
}

void boat_guard::on_mode(double now_s) {
    mode_since_s_ = now_s;
    at_fence_ = false;
    looked_at_.reset();
}

std::optional<boat_guard::order> boat_guard::watch_heading(const guarded_state& now) {
    bool alone = now.mode == sailing_mode::hold || now.mode == sailing_mode::manual;
    if (!alone || now.now_s - mode_since_s_ <= now.heading_time_limit_s) return std::nullopt;
    order made;
    made.station = last_clear_ && limits_ && limits_->clearance_m(of(now.at), station_clearance_m) < station_clearance_m
                       ? of(*last_clear_)
                       : now.at;
    made.why = fmt::format("{} for {:.0f} s without a new command: loiters",
                           now.mode == sailing_mode::hold ? "kept its heading" : "manual", now.heading_time_limit_s);
    return made;
}

std::optional<boat_guard::order> boat_guard::watch_limits(const guarded_state& now) {
    if (!limits_) return std::nullopt;
    auto here = of(now.at);
    if (looked_at_ && (now.now_s - looked_s_ < look_every_s || flat_distance_m(*looked_at_, here) < free_m_))
        return std::nullopt;
    looked_at_ = here;
    looked_s_ = now.now_s;
    double clear_m = limits_->clearance_m(here, look_m);
    free_m_ = std::clamp(clear_m - station_clearance_m, 0.0, free_at_most_m);
    if (clear_m >= station_clearance_m) last_clear_ = here;
    if (!now.fence_on || at_fence_ || clear_m >= margin_m) return std::nullopt;
    double course_deg = std::atan2(now.east_mps, now.north_mps) * 180 / 3.14159265358979;
    auto ahead = flat_destination(here, course_deg, ahead_s * std::hypot(now.east_mps, now.north_mps));
    if (limits_->clearance_m(ahead, look_m) > clear_m + 1) return std::nullopt; // on its way back
    at_fence_ = true;
    bool fence = limits_->fence_clearance_m(here, look_m) <= clear_m;
    order made;
    made.station = of(last_clear_ ? *last_clear_ : refuge(here));
    made.why =
        fmt::format("turned back {} {}, loiters", fence ? "at its fence" : "before the coast",
                    clear_m < 0 ? fmt::format("({:.0f} m beyond)", -clear_m) : fmt::format("({:.0f} m)", clear_m));
    return made;
}

/// The nearest of the places around that is clear enough, else the clearest.
coast_point boat_guard::refuge(coast_point at) const {
    coast_point best = at;
    double most = limits_->clearance_m(at, look_m);
    for (double away_m = 50; away_m <= refuge_reach_m; away_m *= 1.4)
        for (int course = 0; course < 360; course += 15) {
            auto there = flat_destination(at, course, away_m);
            double clear_m = limits_->clearance_m(there, look_m);
            if (clear_m >= station_clearance_m) return there;
            if (clear_m <= most) continue;
            most = clear_m;
            best = there;
        }
    return best;
}

ise::result<void> boat_guard::allows(const waypoint& point, const waypoint* before, const waypoint* after) const {
    if (!limits_) return {};
    auto there = of(point);
    double clear_m = limits_->fence_clearance_m(there, look_m);
    if (clear_m < 0) return ise::failure(ise::errc::refused, "outside the fence; parameter fence 0 allows it");
    if (clear_m < margin_m)
        return ise::failure(ise::errc::refused,
                            fmt::format("{:.0f} m from the fence: it turns back at {:.0f} m", clear_m, margin_m));
    for (const auto* other : {before, after})
        if (other)
            if (auto why = limits_->fence_trouble(of(*other), there))
                return ise::failure(ise::errc::refused, fmt::format("a leg {}", *why));
    return {};
}

ise::result<void> boat_guard::allows(const std::vector<waypoint>& list) const {
    for (std::size_t i = 0; i < list.size(); ++i) {
        const auto* before = list.size() > 1 ? &list[(i + list.size() - 1) % list.size()] : nullptr;
        if (auto good = allows(list[i], before, nullptr); !good)
            return ise::failure(good.error().code(), fmt::format("waypoint {}: {}", i + 1, good.error().message()));
    }
    return {};
}

} // namespace atirma::simulator
