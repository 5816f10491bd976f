#pragma once
#include <components/boat/services.hpp>

#include <ise/core/time.hpp>

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace atirma::stress {

enum class trouble : std::uint8_t {
    carrier_down,      ///< nothing passes over GPRS
    carrier_drops,     ///< its connections break
    carrier_half_open, ///< its connections carry nothing any more, and nobody is told
    carrier_moves,     ///< the boat comes from another address
    carrier_slow,      ///< seconds each way
    air_noise,         ///< half of what goes over XBee is lost
    air_off,           ///< nothing passes over XBee: only in a short plan, whose boat does not sail out of its range
    sky_closed,        ///< the boat's 9602 sees no satellite
    sky_fails,         ///< most sessions break off
    gateway_down,      ///< Iridium's gateway takes and gives nothing
    nodes_parted,      ///< the two communication nodes do not see each other
    primary_killed,
    secondary_killed,
    primary_set_back, ///< killed, and its disk is a backup of minutes before when it starts again
    secondary_set_back,
    names_restarted,
    xbee_proxy_crashed,
    gprs_proxy_crashed,
    iridium_proxy_crashed,
    page_crashed,
    database_crashed, ///< the nodes' database is killed, and started again
    database_stopped, ///< it answers nothing for up to 30 s
    boat_killed,      ///< its computer loses its power; it calls by datagrams in every other life
    operator_away,    ///< the first operator leaves, and comes back
};
/// "the carrier is down".
std::string_view describe(trouble what) noexcept;
/// Over which link it is felt; nothing where it is none of them, or all.
std::optional<link_id> felt_over(trouble what) noexcept;
/// Whether a process is killed or stopped.
constexpr bool kills(trouble what) noexcept { return what >= trouble::primary_killed && what <= trouble::boat_killed; }

struct fault {
    ise::duration at{}, length{}; ///< since the beginning; 0: it is over at once
    trouble what = trouble::carrier_down;
};

/// What an operator does: one telecommand after the other, each when the one before is decided.
struct order {
    ise::duration at{};
    std::size_t by = 0; ///< which operator
    std::vector<boat_command> steps;
    std::optional<link_id> via;
    float valid_s = 600;
    bool by_console = false; ///< given at his console, like by hand; else by a call of the role
};

struct voyage_plan {
    ise::duration length{};
    std::vector<fault> faults; ///< in the order of time
    std::vector<order> orders; ///< in the order of time
    double wind_speed_mps = 6, wind_from_deg = 45;
    double iridium_period_s = 600;
};

inline constexpr std::size_t operators = 2;

/// What happens in a run of that length, by the seed: each trouble at least once, longer runs more of it. Processes are
/// killed one at a time, and the next one only when the last one had time to come back; links suffer at any time.
/// `database`: the nodes share one, which fails, too.
voyage_plan make_plan(std::uint64_t seed, ise::duration length, bool database = false);
/// The same for less than twenty minutes, down to one: fewer troubles, one of each kind, at most one process down at a
/// time. What processes on one machine cannot be made to suffer is left out.
voyage_plan make_short_plan(std::uint64_t seed, ise::duration length, bool database = false);

} // namespace atirma::stress
