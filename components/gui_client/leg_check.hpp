#pragma once
#include <components/coast/sea_limits.hpp>
#include <components/gui_client/view.hpp>

#include <string>
#include <vector>

namespace atirma::console {

/// The place of a waypoint, as `sea_limits` takes it.
inline coast_point point_of(const waypoint& at) { return {at.latitude_deg, at.longitude_deg}; }

/// What is known of the boat when legs are checked.
struct leg_context {
    const sea_limits& limits;
    const boat_view& boat;
    const mission_view& mission;
};

// Why legs that a command would make the boat sail need the operator's override, one problem a line, at most four:
// "the leg from the boat to waypoint 1 crosses land after 420 m". Empty: there is none. Where the boat's position or
// its list is not known, only the rest is checked. Pure.

/// Any telecommand: a new waypoint and its legs, the leg to a waypoint that is selected, all legs for Auto, the
/// course for Heading.
std::string leg_trouble(const leg_context& now, const boat_command& command);
/// A list of waypoints that replaces the boat's: from the boat to the first, and around, as the boat sails in laps.
std::string leg_trouble(const leg_context& now, const std::vector<waypoint>& list);
/// A place before the active waypoint.
std::string leg_trouble(const leg_context& now, const waypoint& place);

/// "not sent: the leg … crosses land…; it takes an override": the refusal of a command without one.
std::string needs_override(const std::string& trouble);

} // namespace atirma::console
