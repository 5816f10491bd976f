#pragma once
#include <components/boat/report_rhythm.hpp>
#include <components/web_server/track_line.hpp>

#include <string>
#include <string_view>
#include <vector>

namespace atirma {

// Rough fixes (with a circular error beyond `rough_fix_m`) are no part of a line: GPX leaves them out, the others tell
// the error beside them. `links` are the names that `track_point::source` counts.
inline constexpr double rough_fix_m = 200;

/// GPX 1.1: the waypoints as a route, the track in segments, which end at outages (`report_rhythm::outage_s`).
std::string to_gpx(std::string_view boat, const std::vector<track_point>& track,
                   const std::vector<track_waypoint>& waypoints, const std::vector<std::string>& links,
                   const report_rhythm& rhythm);

/// KML 2.2 for globes: the track with its times, the waypoints, and the last position.
std::string to_kml(std::string_view boat, const std::vector<track_point>& track,
                   const std::vector<track_waypoint>& waypoints);

/// RFC 4180 with a header line: time_utc (ISO 8601), then the page's columns with their units in the names; what is not
/// known is empty.
std::string to_csv(const std::vector<track_point>& track, const std::vector<std::string>& links);

/// GeoJSON (RFC 7946): the track as a MultiLineString with the times beside it (`coordTimes`), whose lines end at
/// outages, rough fixes and waypoints as points.
std::string to_geojson(std::string_view boat, const std::vector<track_point>& track,
                       const std::vector<track_waypoint>& waypoints, const std::vector<std::string>& links,
                       const report_rhythm& rhythm);

/// "2026-11-21T10:00:00Z", with milliseconds where there are any.
std::string iso_8601(utc_ms at);

} // namespace atirma
