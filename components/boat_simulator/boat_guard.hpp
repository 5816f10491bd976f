#pragma once
#include <components/boat/enums.hpp>
#include <components/boat/packet_header.hpp>
#include <components/coast/sea_limits.hpp>

#include <ise/core/result.hpp>

#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace atirma::simulator {

/// What the guard looks at, each time that the boat has moved.
struct guarded_state {
    double now_s = 0; ///< model time
    waypoint at;
    double east_mps = 0, north_mps = 0; ///< over ground
    sailing_mode mode = sailing_mode::manual;
    bool remote_control = false; ///< somebody else steers: the guard only watches
    bool fence_on = true;        ///< parameter `fence`
    double heading_time_limit_s = 900;
};

/// Keeps the boat within its fence and off the coast, and ends a heading that nobody renews. It decides; the boat
/// steers. Pure.
///
/// At `margin_m` from a limit the boat turns back and loiters at the last place that was `station_clearance_m` away
/// from all limits; without one, at the clearest place around. That it did so shows until the operator sets a mode.
class boat_guard {
public:
    static constexpr double margin_m = 60;
    static constexpr double station_clearance_m = 140; ///< it loiters 40 m to each side, and drifts when it turns

    /// Null: there are no limits.
    explicit boat_guard(std::shared_ptr<const sea_limits> limits) : limits_(std::move(limits)) {}

    /// The boat loiters there now, and says why.
    struct order {
        waypoint station;
        std::string why; ///< a notice
    };
    std::optional<order> update(const guarded_state& now);
    /// The operator set a mode.
    void on_mode(double now_s);
    bool at_fence() const noexcept { return at_fence_; }

    /// Whether a waypoint may stand between these two of a list (null: none). Errors: refused, with the reason.
    ise::result<void> allows(const waypoint& point, const waypoint* before, const waypoint* after) const;
    /// The same for a whole list, sailed in laps.
    ise::result<void> allows(const std::vector<waypoint>& list) const;

private:
    std::optional<order> watch_heading(const guarded_state& now);
    std::optional<order> watch_limits(const guarded_state& now);
    coast_point refuge(coast_point at) const;

    std::shared_ptr<const sea_limits> limits_;
    std::optional<coast_point> last_clear_, looked_at_;
    double looked_s_ = 0, free_m_ = 0; ///< it need not look again within so many metres
    double mode_since_s_ = 0;
    bool at_fence_ = false;
};

} // namespace atirma::simulator
