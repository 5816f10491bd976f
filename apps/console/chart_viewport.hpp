#pragma once
#include "chart_projection.hpp"

#include <optional>
#include <vector>

namespace atirma::console {

/// Which part of the world the chart shows, and whether it follows the boat.
class chart_viewport {
public:
    chart_projection projection;

    bool following() const noexcept { return follow_; }
    void set_follow(bool on) noexcept { follow_ = on; }
    /// On the boat and its waypoints, or where it was left.
    bool placed() const noexcept { return placed_; }
    void set_placed() noexcept { placed_ = true; }

    /// Keeps the boat in the middle part: the chart does not creep all the time. Does nothing where it does not follow.
    void keep_in_sight(const waypoint& boat);
    /// All of these.
    void fit(const std::vector<waypoint>& places);
    /// Around the boat if it follows one, else around `at`.
    void zoom(double factor, QPointF at, const std::optional<waypoint>& boat);
    /// As it was left.
    void place(const waypoint& centre, double metres_per_pixel);

private:
    void set_scale(double metres_per_pixel);

    bool follow_ = true, placed_ = false;
};

} // namespace atirma::console
