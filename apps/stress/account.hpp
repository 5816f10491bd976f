#pragma once
#include "ledger.hpp"
#include "operator_seat.hpp"
#include "plan.hpp"

#include <apps/window_view.hpp>

#include <ise/database/database.hpp>

#include <array>
#include <map>
#include <set>
#include <string>
#include <vector>

namespace atirma::stress {

struct episode {
    ise::duration from{}, until{}; ///< until < from: not over
    std::string what;
    std::optional<link_id> link; ///< over which it is felt
    bool everywhere = false;     ///< over all of them
};

/// How everything was at one instant; what a clock does not have stays 0.
struct sample {
    ise::duration at{};
    std::size_t waiting = 0;  ///< virtual clock: in the scheduler: timers, waits, what is under way
    std::size_t sessions = 0; ///< virtual clock: of all components
    std::size_t gprs_waiting = 0, xbee_queued = 0, xbee_waiting = 0;  ///< at the boat; waiting: for a receipt
    std::array<std::uint64_t, 2> packets{}, unseen{}, held{}, open{}; ///< of the nodes
    bool whole = true;                                                ///< nothing is down
    std::size_t processes = 0, resident_kib = 0, descriptors = 0;     ///< real clock: of all processes together
    /// Stopped components use no memory, and packets that wait for the radio use some temporarily: neither shows
    /// growth.
    bool settled() const noexcept { return whole && xbee_waiting < 256; }
};

/// A telecommand that the boat executed.
struct executed_command {
    std::uint32_t id = 0;
    command_kind kind = command_kind::ping;
    ise::duration at{};
};

struct shown_page {
    std::uint64_t received = 0, duplicates = 0, malformed = 0;
};

/// What an operator's console knew at the end.
struct console_view {
    std::string name;
    bool fix = false; ///< knows where the boat is
    std::size_t links = 0, track = 0, commands = 0, present = 0;
};

/// What became of a voyage, on whichever clock it was sailed: all that findings, report and picture are made of.
struct account {
    std::uint64_t seed = 0;
    voyage_plan plan;
    bool virtual_clock = true;
    bool database = false;   ///< both nodes keep everything in one database
    std::string wind;        ///< in words
    double xbee_range_m = 0; ///< from the short-range node; beyond, nothing is heard; 0: no such limit
    ise::wall_time began{};
    std::vector<episode> episodes;
    std::vector<ledger::iridium_session> sessions;
    std::vector<sample> samples;
    std::array<operator_record, operators> people;
    std::vector<console_view> consoles;
    std::vector<window_view> windows;                ///< real clock: of the operators at windows
    std::map<std::string, std::uint64_t> complaints; ///< warnings and errors, with how often they came
    ise::duration calm{};                            ///< after the end, until nothing was owed any more
    std::size_t set_back = 0;                        ///< times that a backup was put in the place of a node's disk
    shown_page page;
    std::vector<executed_command> executed; ///< virtual clock: by the boat, as they were
    std::set<std::uint32_t> recorded;       ///< ids of the telecommands in the primary node's record
    double sailed_m = 0;
    std::vector<telemetry_packet> packets; ///< of the primary node's disk, in the order of the boat's measurements
};

/// Those that the boat executed after their validity.
std::vector<executed_command> late_executions(const account& of);

console_view view_of(const std::string& name, const console::operator_port& at);

/// Where the short-range node stands.
waypoint short_range_node();

/// The packets on a node's disk, in the order of the boat's measurements; and which they are.
std::vector<telemetry_packet> packets_on(ise::database& disk);
std::set<packet_key> keys_on(ise::database& disk);
/// What the boat's computer keeps of what it sent, until the shore has it.
std::set<packet_key> keys_at_boat(ise::database& memory);
/// Which telecommands are on record there.
std::set<std::uint32_t> commands_on(ise::database& disk);

} // namespace atirma::stress
