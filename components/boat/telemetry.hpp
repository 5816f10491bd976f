#pragma once
#include <components/boat/enums.hpp>
#include <components/boat/packet_header.hpp>

#include <ise/core/bytes.hpp>
#include <ise/core/result.hpp>

#include <array>
#include <cstdint>
#include <string>
#include <variant>
#include <vector>

namespace atirma {

// Directions: true, clockwise from north, 0 <= x < 360. Angles relative to the bow: -180 … 180, starboard positive.

struct location {
    double latitude_deg = 0;
    double longitude_deg = 0;
    fix_quality quality = fix_quality::none;
    std::uint8_t satellites = 0;
    float speed_over_ground_mps = 0;
    float course_over_ground_deg = 0; ///< true, 0 <= x < 360
    float distance_sailed_m = 0;      ///< since its first start, if it has a memory
    bool operator==(const location&) const = default;
};

/// Whether it says where the boat is. A receiver without a fix tells 0°, 0°.
constexpr bool has_fix(const location& where) noexcept {
    return where.quality != fix_quality::none && (where.latitude_deg != 0 || where.longitude_deg != 0);
}

struct navigation {
    sailing_mode mode = sailing_mode::manual;
    tack on = tack::none;
    bool in_irons = false;          ///< head to wind without way: it does not get out by itself
    bool remote_control = false;    ///< the RC receiver overrides the autopilot
    bool beacon = false;            ///< the emergency beacon is on
    float heading_deg = 0;          ///< true, 0 <= x < 360
    float heel_deg = 0;             ///< starboard down positive
    float pitch_deg = 0;            ///< bow up positive
    float rudder_commanded_deg = 0; ///< turns to starboard positive
    float rudder_measured_deg = 0;
    float sail_commanded_deg = 0;    ///< widest angle that the sheet allows, 0 … 90
    float sail_measured_deg = 0;     ///< where the boom stands; out to starboard positive
    std::uint8_t waypoint_index = 0; ///< the one it sails to; meaningless where count is 0
    std::uint8_t waypoint_count = 0;
    float distance_to_waypoint_m = 0;
    float bearing_to_waypoint_deg = 0; ///< true
    float course_to_steer_deg = 0;     ///< true
    float cross_track_error_m = 0;     ///< right of the leg positive
    std::uint16_t laps = 0;            ///< of the whole list, since it was changed
    bool at_fence = false;             ///< it has turned back at its fence or at the coast, and loiters
    bool operator==(const navigation&) const = default;
};

struct wind {
    float apparent_angle_deg = 0; ///< where it comes from, relative to the bow, starboard positive
    float apparent_speed_mps = 0;
    float true_direction_deg = 0; ///< where it comes from, true
    float true_speed_mps = 0;
    bool operator==(const wind&) const = default;
};

struct power {
    float battery_v = 0;
    float battery_a = 0; ///< out of the battery positive
    std::uint8_t battery_percent = 0;
    float temperature_c = 0; ///< inside the hull
    std::uint32_t uptime_s = 0;
    reset_cause last_reset = reset_cause::power_on;
    std::uint16_t faults = 0; ///< bits; 0 is no fault
    bool operator==(const power&) const = default;
};

/// A part of the list of waypoints; several packets tell a long list.
struct waypoints {
    static constexpr std::size_t max_entries = 9;
    std::uint16_t revision = 0; ///< grows with each change of the list: parts of two revisions do not mix
    std::uint8_t count = 0;     ///< of the whole list
    std::uint8_t active = 0;
    std::uint8_t first = 0;        ///< index of the first entry here
    std::vector<waypoint> entries; ///< at most max_entries
    bool operator==(const waypoints&) const = default;
};

struct configuration {
    std::uint16_t revision = 0;
    float time_to_next_tack_s = 0;
    float forbidden_angle_upwind_deg = 0;
    float forbidden_angle_downwind_deg = 0;
    float leeway_compensation = 0;                      ///< 0 none … 1 full
    std::array<float, link_count> telemetry_period_s{}; ///< by link_id; 0 is off
    bool operator==(const configuration&) const = default;
};

/// One link as the boat sees it.
struct link_status {
    link_id link = link_id::xbee;
    bool up = false;
    std::int16_t rssi_dbm = 0; ///< of the last packet heard; 0 unknown
    std::uint16_t queued = 0;
    std::uint32_t sent = 0;
    std::uint32_t failed = 0;
    std::uint32_t dropped = 0; ///< never sent: the queue was full
    float last_heard_age_s = 0;
    bool operator==(const link_status&) const = default;
};

/// Something that happened, in words.
struct notice {
    static constexpr std::size_t max_text = 80;
    std::string text; ///< UTF-8, cut to max_text bytes when encoded
    bool operator==(const notice&) const = default;
};

using telemetry_body = std::variant<location, navigation, wind, power, waypoints, configuration, link_status, notice>;

struct telemetry_message {
    packet_header header;
    telemetry_body body;
    bool operator==(const telemetry_message&) const = default;
};

/// "location", "navigation", …
std::string_view name_of(const telemetry_body& body) noexcept;

/// The packet as it goes on air, at most max_packet_size bytes. Values outside what the layout can hold are clamped,
/// directions wrapped, non-finite numbers become 0. Throws `ise::error` (invalid_argument) only for more than
/// `waypoints::max_entries` entries.
ise::bytes encode_telemetry(const packet_header& header, const telemetry_body& body);

/// The packet in `raw`, or `malformed` with what is wrong: length, version, checksum, type, a number without a name.
/// The checksum is looked at before anything else but the length.
ise::result<telemetry_message> parse_telemetry(ise::bytes_view raw);

} // namespace atirma
