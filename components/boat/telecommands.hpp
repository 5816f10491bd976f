#pragma once
#include <components/boat/enums.hpp>
#include <components/boat/packet_header.hpp>
#include <components/boat/parameters.hpp>

#include <array>
#include <chrono>
#include <string>
#include <variant>

/// All that the boat can be told. To add a telecommand: its number in `command_kind`, a struct of the same name, that
/// struct at the end of `any_telecommand`, and what the boat does (components/boat_simulator/boat_commands.cpp). Links,
/// proxies, the console and the record take it from here.
///
/// A struct's fields are the arguments, and travel in their order (README.md): enumerations, bool, whole numbers,
/// float, `waypoint`, `std::string` (raw_payload.hpp). Arguments of one name have one type in all telecommands.
namespace atirma {

/// The numbers on air, never reused, and the names that people type.
enum class command_kind : std::uint8_t {
    ping = 0,
    set_mode = 1,
    waypoint_add = 2,
    waypoint_insert = 3,
    waypoint_delete = 4,
    waypoint_clear = 5,
    waypoint_read_back = 6,
    waypoint_select = 7,
    set_parameter = 8,
    get_parameter = 9,
    tack_now = 10,
    gybe_now = 11,
    set_telemetry_period = 12,
    request_status = 13,
    reboot = 14,
    emergency_beacon = 15,
    mission_stage = 16,
    mission_switch = 17,
    raw = 18,
};
extern template std::span<const enum_name<command_kind>> names_of() noexcept;

/// The order in which telecommands leave the shore where one goes at a time.
enum class command_priority : std::uint8_t { saves = 0, steers = 1, asks = 2 };

struct command_traits {
    command_kind kind;
    std::string_view help; ///< what the boat does
    /// As an operator reads it: {argument} stands for its value, {argument+1} for that of an index, which people count
    /// from 1; default: the name.
    std::string_view words = {};
    /// Whether the boat obeys it only under the highest epoch of authority that it has heard. Others ask, and change
    /// nothing.
    bool needs_authority = true;
    command_priority priority = command_priority::steers;
    bool returns_value = false; ///< the acknowledgement's `value` is what holds at the boat now
    bool steers = false;        ///< moves rudder and sails: refused while the remote control has them
    /// The validity where the operator names none, over XBee and GPRS, and over Iridium, whose sessions are minutes
    /// apart.
    std::chrono::seconds valid{60}, valid_by_satellite{3600};
};

/// What a number may be. One that is not listed in `ranges()` may be any.
struct argument_range {
    std::string_view argument; ///< the field's name
    double minimum, maximum;
    std::string_view unit;
    bool zero_is_off = false;           ///< 0 is allowed too, whatever the range
    std::string_view called = argument; ///< in messages
};

// Each has `traits`, and may have
//   ranges()  its `argument_range`s;
//   danger()  why the operator must confirm it, as it can lose the boat or its mission; empty: it cannot;
//   caution() why the console asks before it sends it, though it need not; {argument} as in `words`;
//   replaces(older)  whether it takes the place of an older one of its kind that is still open, as only the newest
//                    counts: the shore then calls the older one back, which else could be executed after it.
namespace commands {

struct ping {
    static constexpr command_traits traits{.kind = command_kind::ping,
                                           .help = "Answers, with its boot and uptime.",
                                           .needs_authority = false,
                                           .priority = command_priority::asks};
};

struct set_mode {
    sailing_mode mode = sailing_mode::manual;

    static constexpr command_traits traits{.kind = command_kind::set_mode,
                                           .help = "Sails in that mode.",
                                           .words = "mode {mode}",
                                           .priority = command_priority::saves,
                                           .steers = true};
    constexpr std::string_view danger() const {
        if (mode != sailing_mode::manual) return {};
        return "Rudder and sail stay as they are; without somebody at the remote control nobody steers.";
    }
    constexpr bool replaces(const set_mode&) const { return true; }
};

struct waypoint_insert {
    std::uint8_t index = 0; ///< the place that it gets, from 0
    waypoint point;

    static constexpr command_traits traits{.kind = command_kind::waypoint_insert,
                                           .help = "Puts a waypoint before the one at that place of the list.",
                                           .words = "insert waypoint {index+1} at {point}",
                                           .returns_value = true,
                                           .valid = std::chrono::seconds(300)};
};

struct waypoint_add {
    waypoint point;

    static constexpr command_traits traits{.kind = command_kind::waypoint_add,
                                           .help = "Puts a waypoint at the end of the list.",
                                           .words = "add waypoint at {point}",
                                           .returns_value = true,
                                           .valid = std::chrono::seconds(300)};
};

struct waypoint_delete {
    std::uint8_t index = 0;

    static constexpr command_traits traits{.kind = command_kind::waypoint_delete,
                                           .help = "Removes a waypoint from the list.",
                                           .words = "delete waypoint {index+1}",
                                           .returns_value = true,
                                           .valid = std::chrono::seconds(300)};
};

struct waypoint_clear {
    static constexpr command_traits traits{.kind = command_kind::waypoint_clear,
                                           .help = "Removes all waypoints from the list.",
                                           .words = "clear waypoints",
                                           .returns_value = true,
                                           .valid = std::chrono::seconds(300)};
    constexpr std::string_view danger() const {
        return "The boat loses its list of waypoints; in Auto it then stays where it is.";
    }
};

struct waypoint_read_back {
    static constexpr command_traits traits{.kind = command_kind::waypoint_read_back,
                                           .help = "Sends its list of waypoints.",
                                           .words = "read waypoints back",
                                           .needs_authority = false,
                                           .priority = command_priority::asks,
                                           .returns_value = true};
};

struct waypoint_select {
    std::uint8_t index = 0;

    static constexpr command_traits traits{.kind = command_kind::waypoint_select,
                                           .help = "Makes a waypoint of the list the next one.",
                                           .words = "sail to waypoint {index+1}",
                                           .returns_value = true,
                                           .steers = true,
                                           .valid = std::chrono::seconds(300)};
    constexpr bool replaces(const waypoint_select&) const { return true; }
};

struct set_parameter {
    parameter_id parameter = parameter_id::time_to_next_tack;
    float value = 0;

    static constexpr command_traits traits{.kind = command_kind::set_parameter,
                                           .help = "Changes a parameter.",
                                           .words = "{parameter} := {value}",
                                           .returns_value = true,
                                           .valid = std::chrono::seconds(300)};
    std::array<argument_range, 1> ranges() const { return {range_of("value", parameter)}; }
    constexpr std::string_view danger() const {
        if (parameter != parameter_id::fence || value != 0) return {};
        return "The boat then leaves its fence and sails onto the coast if its course leads there.";
    }
    constexpr bool replaces(const set_parameter& older) const { return parameter == older.parameter; }
    static argument_range range_of(std::string_view argument, parameter_id id); ///< parameters.hpp has them
};

struct get_parameter {
    parameter_id parameter = parameter_id::time_to_next_tack;

    static constexpr command_traits traits{.kind = command_kind::get_parameter,
                                           .help = "Tells a parameter.",
                                           .words = "get {parameter}",
                                           .needs_authority = false,
                                           .priority = command_priority::asks,
                                           .returns_value = true};
};

struct tack_now {
    static constexpr command_traits traits{.kind = command_kind::tack_now,
                                           .help = "Goes through the wind now.",
                                           .steers = true,
                                           .valid = std::chrono::seconds(30),
                                           .valid_by_satellite = std::chrono::seconds(900)};
    constexpr bool replaces(const tack_now&) const { return true; }
};

struct gybe_now {
    static constexpr command_traits traits{.kind = command_kind::gybe_now,
                                           .help = "Goes round before the wind now.",
                                           .steers = true,
                                           .valid = std::chrono::seconds(30),
                                           .valid_by_satellite = std::chrono::seconds(900)};
    constexpr bool replaces(const gybe_now&) const { return true; }
};

struct set_telemetry_period {
    link_id link = link_id::xbee;
    float period_s = 0;

    static constexpr command_traits traits{.kind = command_kind::set_telemetry_period,
                                           .help = "Sends telemetry over a link that often.",
                                           .words = "telemetry over {link}: {period_s}",
                                           .returns_value = true,
                                           .valid = std::chrono::seconds(300)};
    constexpr std::array<argument_range, 1> ranges() const {
        return {
            argument_range{.argument = "period_s", .minimum = 0.5, .maximum = 86400, .unit = "s", .zero_is_off = true}};
    }
    constexpr std::string_view caution() const {
        if (period_s == 0) return "Nothing will be heard over {link} until it is switched on again.";
        if (link == link_id::iridium && period_s < 60)
            return "Iridium is paid by the message: such a short period costs much.";
        return {};
    }
    constexpr bool replaces(const set_telemetry_period& older) const { return link == older.link; }
};

struct request_status {
    static constexpr command_traits traits{.kind = command_kind::request_status,
                                           .help = "Sends one packet of each type at once.",
                                           .needs_authority = false,
                                           .priority = command_priority::asks};
};

struct reboot {
    static constexpr command_traits traits{.kind = command_kind::reboot, .help = "Starts its computer again."};
    constexpr std::string_view danger() const {
        return "The boat's computer starts again: for some seconds nobody steers, and nothing is heard from it.";
    }
};

struct emergency_beacon {
    bool on = true;

    static constexpr command_traits traits{.kind = command_kind::emergency_beacon,
                                           .help = "Switches the emergency beacon on or off.",
                                           .words = "beacon {on}",
                                           .priority = command_priority::saves,
                                           .valid = std::chrono::seconds(600)};
    constexpr std::string_view danger() const {
        return on ? "The emergency beacon calls for help, and draws on the battery."
                  : "The emergency beacon goes off: who is on the way to the boat loses it.";
    }
    constexpr bool replaces(const emergency_beacon&) const { return true; }
};

/// A whole list of waypoints goes up in parts that change nothing, and is put in the place of the boat's list by one
/// telecommand: the boat has the old list or the new one, whatever is lost on the way.
struct mission_stage {
    std::uint8_t index = 0; ///< the place that it has in the new list, from 0
    waypoint point;

    static constexpr command_traits traits{.kind = command_kind::mission_stage,
                                           .help = "Keeps a waypoint of a new list, and goes on with its own.",
                                           .words = "stage waypoint {index+1} at {point}",
                                           .valid = std::chrono::seconds(300)};
};

struct mission_switch {
    std::uint8_t count = 0;     ///< waypoints of the new list, staged from 0 on
    std::uint32_t checksum = 0; ///< of these (mission_checksum.hpp); others are refused, and the list stays

    static constexpr command_traits traits{.kind = command_kind::mission_switch,
                                           .help = "Puts the staged list in the place of its own.",
                                           .words = "switch to the staged list of {count}",
                                           .returns_value = true,
                                           .valid = std::chrono::seconds(300)};
    constexpr std::string_view danger() const {
        if (count != 0) return {};
        return "The boat loses its list of waypoints; in Auto it then stays where it is.";
    }
};

/// For what no other telecommand can do. Off by default, at the nodes and aboard.
struct raw {
    std::string payload; ///< text, or hexadecimal as "hex:0A1B" (raw_payload.hpp); at most 64 bytes

    static constexpr command_traits traits{.kind = command_kind::raw,
                                           .help = "Gives bytes to its controller as they are.",
                                           .words = "raw {payload}",
                                           .steers = true};
    constexpr std::string_view danger() const {
        return "The boat's controller gets these bytes as they are: neither shore nor boat checks what they do.";
    }
};

/// Of a newer shore: its arguments cannot be read. It has no traits.
struct unknown {
    command_kind kind{};
};

} // namespace commands

/// All of them. Their arguments, each name once in the order of this list, are the fields of `boat_command` in messages
/// and records: a new telecommand goes to the end, before `unknown`.
using any_telecommand =
    std::variant<commands::ping, commands::set_mode, commands::waypoint_insert, commands::waypoint_add,
                 commands::waypoint_delete, commands::waypoint_clear, commands::waypoint_read_back,
                 commands::waypoint_select, commands::set_parameter, commands::get_parameter, commands::tack_now,
                 commands::gybe_now, commands::set_telemetry_period, commands::request_status, commands::reboot,
                 commands::emergency_beacon, commands::mission_stage, commands::mission_switch, commands::raw,
                 commands::unknown>;

} // namespace atirma
