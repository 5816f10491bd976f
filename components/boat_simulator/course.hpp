#pragma once
#include <components/boat/telemetry.hpp>

#include <optional>
#include <string_view>
#include <vector>

namespace atirma::simulator {

/// A course of waypoints, sailed in laps.
struct course {
    std::string_view name;
    std::vector<waypoint> marks;
};

/// "T1" or "T2", triangles in the bay of El Confital; empty for any other name.
std::optional<course> find_course(std::string_view name);

} // namespace atirma::simulator
