#pragma once
#include <ise/packet/codec.hpp>

#include <chrono>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <unordered_map>
#include <variant>
#include <vector>

/// Packets that the tests of this layer share.
namespace example {

enum class mode : std::uint8_t { idle, autopilot, manual = 7 };

struct waypoint {
    std::string name;
    double latitude_deg = 0;
    double longitude_deg = 0;
    bool operator==(const waypoint&) const = default;
};

struct position {
    double latitude_deg = 28.15;
    double longitude_deg = -15.45;
    float speed_kn = 0;
    std::uint16_t heading_deg = 0;
    std::int16_t roll_ddeg = 0;
    std::uint16_t battery_mv = 0;
    bool operator==(const position&) const = default;
};

struct empty {
    bool operator==(const empty&) const = default;
};

/// One of everything.
struct everything {
    bool yes = true;
    char letter = 'x';
    std::int8_t i8 = -1;
    std::uint64_t u64 = 1;
    float f = 0.5F;
    double d = -2;
    mode helm = mode::autopilot;
    std::string text;
    std::vector<waypoint> waypoints;
    std::vector<float> samples;
    std::vector<bool> flags;
    std::vector<std::byte> raw;
    std::array<std::int16_t, 2> pair_of_i16{};
    int matrix[2][2] = {{1, 2}, {3, 4}};
    std::optional<waypoint> home;
    std::variant<std::int32_t, std::string, waypoint> choice;
    std::map<std::string, double> parameters;
    std::unordered_map<std::uint16_t, std::string> names;
    std::set<std::uint8_t> seen;
    std::pair<std::int32_t, bool> couple;
    std::tuple<char, double> triple;
    std::chrono::milliseconds period{0};
    std::chrono::sys_time<std::chrono::microseconds> at{};
    position nested;
    empty nothing;
};

inline everything filled() {
    everything e;
    e.text = "vela";
    e.waypoints = {{"a", 1, 2}, {"bc", 3, 4}};
    e.samples = {1, 2.5F};
    e.flags = {true, false, true};
    e.raw = {std::byte{1}, std::byte{255}};
    e.pair_of_i16 = {-1, 300};
    e.home = waypoint{"home", 28, -15};
    e.choice = "second";
    e.parameters = {{"gain", 0.5}, {"trim", -1}};
    e.names = {{513, "x"}, {2, "y"}, {256, "z"}};
    e.seen = {3, 1, 2};
    e.couple = {-5, true};
    e.triple = {'q', 0.25};
    e.period = std::chrono::milliseconds(1500);
    e.at = std::chrono::sys_days(std::chrono::year(2017) / 9 / 4) + std::chrono::microseconds(1);
    e.nested.speed_kn = 2;
    return e;
}

inline std::string hex(ise::bytes_view raw) {
    std::string text;
    for (std::byte b : raw) {
        constexpr char digits[] = "0123456789abcdef";
        text += digits[std::to_integer<unsigned>(b) >> 4];
        text += digits[std::to_integer<unsigned>(b) & 15];
    }
    return text;
}

/// The failure that f throws.
template <class F>
ise::failure failure_of(F&& f) {
    try {
        f();
    } catch (const ise::error& why) {
        return why.why();
    }
    return ise::failure(ise::errc::invalid_argument, "nothing was thrown");
}

} // namespace example
