#pragma once
#include <chrono>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace atirma {

/// UTC, from the environment of the node: nothing here reads a clock.
using utc_ms = std::chrono::sys_time<std::chrono::milliseconds>;

/// Where and when a report comes from. Angles are degrees, clockwise; directions are true, 0 <= x < 360.
struct report_origin {
    utc_ms measured_at;   ///< by the boat
    utc_ms received_at;   ///< by the shore
    std::string source;   ///< the link it came by: "xbee", "gprs", "iridium"; "beacon": from the second controller
    bool history = false; ///< sent again after a gap: fills the track
};

struct position_update {
    report_origin from;
    double latitude_deg = 0;
    double longitude_deg = 0;
    std::optional<double> speed_over_ground_mps;
    std::optional<double> course_over_ground_deg;
    std::optional<double> circular_error_m; ///< of fixes that are rough, such as Iridium's own
    std::optional<int> satellites;
};

struct navigation_update {
    report_origin from;
    std::optional<double> heading_deg;
    std::optional<double> heel_deg;  ///< starboard down is positive
    std::optional<double> pitch_deg; ///< bow up is positive
    std::optional<double> rudder_deg;
    std::optional<double> course_to_steer_deg;
    std::optional<double> cross_track_error_m;  ///< right of the leg is positive
    std::optional<std::size_t> active_waypoint; ///< index into the last waypoints_update
};

struct wind_update {
    report_origin from;
    std::optional<double> apparent_angle_deg; ///< from the bow, -180 < x <= 180, starboard is positive
    std::optional<double> apparent_speed_mps;
    std::optional<double> true_direction_deg; ///< where it blows from
    std::optional<double> true_speed_mps;
};

struct power_update {
    report_origin from;
    std::optional<double> battery_voltage_v;
    std::optional<double> battery_current_a; ///< out of the battery is positive
    std::optional<double> battery_charge_percent;
};

struct track_waypoint {
    double latitude_deg = 0;
    double longitude_deg = 0;
    std::string name; ///< may be empty
};

struct waypoints_update {
    report_origin from;
    std::vector<track_waypoint> points;
    std::optional<std::size_t> active; ///< the one the boat steers for
    bool closed = false;               ///< after the last comes the first
};

struct mode_update {
    report_origin from;
    std::string mode; ///< "auto", "hold", "manual"…; "remote_control" while that has rudder and sail
};

/// How well the boat hears the shore.
struct signal_update {
    report_origin from;
    std::string link;               ///< that is heard, whichever link told it
    std::optional<double> rssi_dbm; ///< of the last packet that the boat heard
};

/// Whether the server itself is in touch with what brings the boat's reports: the proxy of a link, or the
/// communication nodes that follow several links.
struct feed_update {
    std::string source; ///< "xbee", "gprs", "iridium", "communication"
    bool connected = false;
    utc_ms since;                     ///< of `connected`
    std::string detail;               ///< "name server lost"; may be empty
    bool link = true;                 ///< false: not a link of the boat's, but who follows them
    std::optional<utc_ms> last_heard; ///< the boat, over this link, as the communication nodes tell
};

} // namespace atirma
