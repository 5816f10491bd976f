#pragma once
#include <chrono>
#include <cstddef>
#include <cstdint>

/// What all packets of the boat have in common.
namespace atirma {

/// No packet is longer than this, header and checksum included: one XBee 868 frame.
inline constexpr std::size_t max_packet_size = 100;

using utc_time = std::chrono::sys_time<std::chrono::milliseconds>;

/// A place on the chart (WGS 84).
struct waypoint {
    double latitude_deg = 0;  ///< -90 … 90, north positive
    double longitude_deg = 0; ///< -180 … 180, east positive
    bool operator==(const waypoint&) const = default;
};

/// The boot in packets of the boat's second controller, which tells the position while the main one fails. The main
/// controller never has it. Their sequences never repeat, also over a restart of that controller.
inline constexpr std::uint16_t beacon_boot = 0;

/// Who measured, when, and which packet of that boot it is: (boot, sequence) tells duplicates on all links.
struct packet_header {
    std::uint16_t boot = 0;
    std::uint32_t sequence = 0;
    utc_time measured_at{};
    bool operator==(const packet_header&) const = default;
};

} // namespace atirma
