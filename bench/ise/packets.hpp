#pragma once
#include <ise/packet/concept.hpp>
#include <ise/session/contract.hpp>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace bench {

/// A payload of 64 bytes in fields, as telemetry is.
struct telemetry {
    std::int64_t stamp_ns = 0;
    double latitude_deg = 0, longitude_deg = 0;
    float heading_deg = 0, speed_kn = 0, wind_deg = 0, wind_kn = 0;
    std::uint32_t sequence = 0, mode = 0;
    double roll_deg = 0, pitch_deg = 0;
};

/// A payload of any other size.
struct block {
    std::int64_t stamp_ns = 0;
    std::vector<std::uint8_t> content;
};

inline constexpr std::size_t telemetry_bytes = 64;

template <class Packet>
Packet make_packet(std::size_t size_bytes);
template <>
inline telemetry make_packet<telemetry>(std::size_t) {
    return telemetry{};
}
template <>
inline block make_packet<block>(std::size_t size_bytes) {
    block made;
    made.content.resize(size_bytes - sizeof made.stamp_ns);
    return made;
}

template <class Packet>
inline constexpr ise::request_response<Packet, Packet> echo{"echo"};
/// The name of the service at a place: a service keeps a view of it, so that it lives as long as the program.
inline std::string_view echo_name(std::size_t place) {
    static std::vector<std::unique_ptr<const std::string>> made;
    if (place == 0) return "echo";
    while (made.size() < place)
        made.push_back(std::make_unique<const std::string>("echo-" + std::to_string(made.size() + 1)));
    return *made[place - 1];
}
template <class Packet>
inline constexpr ise::subscription<Packet> feed{"feed"};

/// What the serving process holds, for what a connection costs.
struct ask_memory {};
struct memory_used {
    std::uint64_t heap_bytes = 0;     ///< in use, as malloc counts
    std::uint64_t resident_bytes = 0; ///< anonymous pages
    std::uint32_t sessions = 0;
};
inline constexpr ise::request_response<ask_memory, memory_used> memory{"memory"};

} // namespace bench
