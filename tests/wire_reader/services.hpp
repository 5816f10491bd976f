// What the two programs of a recorded session talk about: packets of every kind, and two versions of some.
#pragma once
#include <ise/ise.hpp>
#include <ise/packet/archive.hpp>

#include <cereal/types/memory.hpp>

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <tuple>
#include <unordered_map>
#include <utility>
#include <variant>
#include <vector>

namespace recorded {

enum class mood : std::int8_t { angry = -3, calm = 0, keen = 3 };

struct waypoint {
    std::uint16_t number = 7;
    std::string name = "none";
    std::optional<float> speed_kn;
};

/// A list by pointers, which only its own serialize can follow.
struct chain {
    std::uint32_t here = 0;
    std::unique_ptr<chain> next;
    template <class Archive>
    void serialize(Archive& archive) {
        archive(here, next);
    }
};

struct scalars {
    bool flag = true;
    char letter = 'x';
    std::byte raw{0xa5};
    std::int8_t i8 = -8;
    std::uint8_t u8 = 200;
    std::int16_t i16 = -1600;
    std::uint16_t u16 = 60000;
    std::int32_t i32 = -2'000'000'000;
    std::uint32_t u32 = 4'000'000'000;
    std::int64_t i64 = std::numeric_limits<std::int64_t>::min();
    std::uint64_t u64 = std::numeric_limits<std::uint64_t>::max();
    float f32 = 2.1f;
    double f64 = 28.15;
    double infinite = -std::numeric_limits<double>::infinity();
    mood feels = mood::angry;
    mood strange = mood{77};
};

struct everything {
    scalars plain;
    std::string text = "Gáldar";
    std::vector<std::int32_t> numbers{1, -2, 3};
    std::vector<bool> bits{true, false};
    std::vector<std::byte> raw{std::byte{1}, std::byte{2}};
    std::vector<char> letters{'a', 'b'};
    std::set<std::uint16_t> keys{500, 3};
    std::map<std::string, double> named{{"b", 2}, {"a", 1.5}};
    std::unordered_map<std::uint8_t, waypoint> points{{9, {}}, {4, {1, "buoy", 3.5f}}};
    std::array<char, 8> code{'I', 'S', 'E'};
    std::array<waypoint, 2> corners{waypoint{}, waypoint{2, "cape", {}}};
    std::optional<std::string> present = "here";
    std::optional<std::string> absent;
    std::optional<std::optional<std::uint8_t>> nested = std::optional<std::uint8_t>{};
    std::variant<std::int32_t, std::string, waypoint> choice = waypoint{3, "isle", {}};
    std::tuple<std::uint8_t, std::string> both{1, "one"};
    std::pair<mood, bool> pair{mood::keen, true};
    std::chrono::milliseconds wait{-1500};
    std::chrono::duration<double> exact{0.25};
    std::chrono::minutes odd{7};
    std::chrono::sys_time<std::chrono::milliseconds> at{std::chrono::milliseconds(1'795'248'000'123)};
    chain links;
};

struct text {
    std::string said;
};
struct blob {
    std::vector<std::uint8_t> content;
};
struct fix {
    std::uint32_t number = 0;
    double latitude_deg = 28.15;
};
struct from_number {
    std::uint32_t first = 100;
};
struct reason {
    std::string why = "done";
};

/// What the provider is asked to publish: `count` packets at once, or as fast as lossless subscribers take them.
struct burst {
    std::uint32_t count = 0;
    std::uint32_t bytes = 0; ///< of each picture
    bool send = false;
};

inline constexpr ise::request_response<everything, everything> mirror{"mirror"};
inline constexpr ise::request_response<text, text> helm{"helm"};
inline constexpr ise::request_response<text, text> never{"never"};
inline constexpr ise::request_response<text, text> word{"word"};
inline constexpr ise::request_response<text, ise::nothing> tell{"tell"};
inline constexpr ise::request_response<text, text> ask_back{"ask_back"}; ///< answers what its caller's helm answers
inline constexpr ise::request_response<blob, blob> echo{"echo"};
inline constexpr ise::request_response<burst, ise::nothing> publish_fixes{"publish_fixes"};
inline constexpr ise::request_response<burst, ise::nothing> publish_pictures{"publish_pictures"};
inline constexpr ise::request_response<burst, ise::nothing> publish_weather{"publish_weather"};
inline constexpr ise::request_response<ise::nothing, ise::nothing> withdraw_pictures{"withdraw_pictures"};
inline constexpr ise::subscription<fix, from_number, text, reason, text> fixes{"fixes"};
inline constexpr ise::subscription<blob> pictures{"pictures"};

namespace older { // how the provider knows them
struct route {
    std::vector<waypoint> waypoints;
};
struct route_set {
    std::uint32_t count = 0;
    std::string note = "taken";
};
struct wind {
    float speed_kn = 12;
    std::uint8_t gusts = 3;
};
inline constexpr ise::request_response<route, route_set> plan{"plan"};
inline constexpr ise::subscription<wind, ise::nothing, text> weather{"weather"};
inline constexpr ise::request_response<text, text> moved{"moved"};
} // namespace older

namespace newer { // how the asker knows them
struct route {
    std::vector<waypoint> waypoints;
    mood feels = mood::keen;
};
struct route_set {
    std::uint32_t count = 0;
};
struct wind {
    float speed_kn = 12;
    std::uint8_t gusts = 3;
    std::string from = "north";
};
struct renamed {
    std::string spoken;
};
inline constexpr ise::request_response<route, route_set> plan{"plan"};
inline constexpr ise::subscription<wind, ise::nothing, text> weather{"weather"};
inline constexpr ise::request_response<renamed, text> moved{"moved"};
} // namespace newer

} // namespace recorded

template <>
struct ise::opaque_type<recorded::chain> {
    static constexpr std::string_view name = "test/chain";
    static constexpr std::uint32_t version = 1;
};
