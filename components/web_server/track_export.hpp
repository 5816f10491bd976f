#pragma once
#include <components/web_server/track_line.hpp>

#include <string>
#include <string_view>
#include <vector>

namespace atirma {

/// GPX 1.1: the waypoints as a route, the track in segments that end where nothing was heard for ten minutes.
std::string to_gpx(std::string_view boat, const std::vector<track_point>& track, const std::vector<track_waypoint>& waypoints);

/// KML 2.2 for globes: the track with its times, the waypoints, and the last position.
std::string to_kml(std::string_view boat, const std::vector<track_point>& track, const std::vector<track_waypoint>& waypoints);

} // namespace atirma
