#pragma once
#include <ise/packet/enums.hpp>

#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

namespace atirma {

// The numbers of every enumeration here travel on air (README.md): they are never reused. Telecommands are in
// telecommands.hpp.

enum class sailing_mode : std::uint8_t {
    // In the windows: Manual, Heading, Auto, RTL, Loiter (gui_client/words.cpp), as other autopilots call them.
    manual = 0,       ///< actuators stay where they are; whoever holds the remote control steers
    hold = 1,         ///< keeps the heading it had when the mode was set, for heading_time_limit at most
    automatic = 2,    ///< sails the waypoints
    return_home = 3,  ///< sails to the home position, then keeps station there
    station_keep = 4, ///< stays around the position where the mode was set
};

enum class link_id : std::uint8_t { xbee = 0, gprs = 1, iridium = 2 };
inline constexpr std::size_t link_count = 3;

enum class tack : std::uint8_t { none = 0, port = 1, starboard = 2 }; ///< the side the wind comes from

enum class fix_quality : std::uint8_t { none = 0, gps = 1, differential = 2, simulated = 8 };

enum class reset_cause : std::uint8_t { power_on = 0, commanded = 1, watchdog = 2, brown_out = 3 };

/// What a parameter command names. Units in parameters.hpp.
enum class parameter_id : std::uint8_t {
    time_to_next_tack = 0,
    forbidden_angle_upwind = 1,
    forbidden_angle_downwind = 2,
    telemetry_period = 3,
    leeway_compensation = 4,
    heading_time_limit = 5,
    fence = 6,
};
inline constexpr std::size_t parameter_count = 7;

enum class ack_code : std::uint8_t {
    done = 0,
    refused = 1,      ///< understood and not possible now; the text says why
    bad_argument = 2, ///< out of range; the text says which
    unknown_command = 3,
    no_authority =
        4,       ///< sent under an epoch of authority that the boat does not obey; the answer has the one that it obeys
    expired = 5, ///< it arrived after its validity, or the boat cannot tell; not executed, the text says why
};

/// A name and its value, as people type it: {"return_home", sailing_mode::return_home}.
template <class E>
struct enum_name {
    std::string_view name;
    E value;
};

/// The names of an enumeration in the order of their numbers: its enumerators as they are written in C++.
template <class E>
std::span<const enum_name<E>> names_of() noexcept {
    static const auto names = [] {
        std::vector<enum_name<E>> all;
        for (const auto& one : ise::enumerators<E>()) all.push_back({one.name, static_cast<E>(one.value)});
        return all;
    }();
    return names;
}

/// "return_home"; "unknown" for a number without a name.
template <class E>
std::string_view name_of(E value) noexcept {
    for (auto& entry : names_of<E>())
        if (entry.value == value) return entry.name;
    return "unknown";
}

/// The value of that name, or nothing.
template <class E>
std::optional<E> from_name(std::string_view name) noexcept {
    for (auto& entry : names_of<E>())
        if (entry.name == name) return entry.value;
    return std::nullopt;
}

/// Whether a number that came over the air has a name.
template <class E>
bool is_known(E value) noexcept {
    for (auto& entry : names_of<E>())
        if (entry.value == value) return true;
    return false;
}

// Looking for enumerators takes the compiler long: enums.cpp does it once.
extern template std::span<const enum_name<sailing_mode>> names_of() noexcept;
extern template std::span<const enum_name<link_id>> names_of() noexcept;
extern template std::span<const enum_name<tack>> names_of() noexcept;
extern template std::span<const enum_name<fix_quality>> names_of() noexcept;
extern template std::span<const enum_name<reset_cause>> names_of() noexcept;
extern template std::span<const enum_name<parameter_id>> names_of() noexcept;
extern template std::span<const enum_name<ack_code>> names_of() noexcept;

} // namespace atirma
