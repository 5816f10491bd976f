#pragma once
#include <components/boat/link_budget.hpp>
#include <components/boat/link_seal.hpp>
#include <components/boat/services.hpp>

// What the GPRS proxy provides besides telemetry, telecommand and telecommand_state.
namespace atirma {

/// What the boat's mobile contract was charged for, in bytes with an estimate of their headers.
struct gprs_spending {
    std::uint64_t from_boat_bytes = 0;
    std::uint64_t to_boat_bytes = 0;
    std::uint64_t bytes() const noexcept { return from_boat_bytes + to_boat_bytes; }
};

/// The link as the shore sees it, every two seconds and when the boat comes or goes.
struct gprs_state {
    std::vector<std::string> listening; ///< endpoints that the boat can call
    bool connected = false;
    std::string from;                        ///< the boat's address now, or the last one: "tcp://10.64.0.9:40112"
    std::string trouble;                     ///< why the boat is not there, or why nothing is acknowledged; empty else
    std::optional<utc_time> connected_since; ///< by that address
    std::optional<utc_time> last_heard;
    std::uint16_t boot = 0;         ///< of the boat's numbering on this link
    std::uint32_t acknowledged = 0; ///< all up to this number of that boot are safe
    std::uint32_t announced = 0;    ///< the highest number that the boat told of
    std::uint64_t not_safe_yet = 0; ///< packets that came, and are not acknowledged therefore
    std::uint64_t logins = 0;
    std::uint64_t moves = 0;            ///< the boat came by another address while it was still there by one
    std::uint64_t half_open = 0;        ///< ways that were given up because the boat was silent
    std::uint64_t packets_received = 0; ///< first time, of any kind
    std::uint64_t telemetry_published = 0;
    std::uint64_t history = 0;    ///< of these
    std::uint64_t resends = 0;    ///< numbers that came again: dropped
    std::uint64_t duplicates = 0; ///< packets that came again under another number: dropped
    std::uint64_t postponed = 0;  ///< no room to remember them: they come again
    std::uint64_t given_up = 0;   ///< numbers that the boat had no memory for any more: lost on this link
    std::uint64_t malformed = 0;  ///< lines and packets that make no sense: dropped
    std::uint64_t strangers = 0;  ///< connections without a login now
    std::uint64_t strangers_cut_off = 0;
    std::uint64_t stranger_datagrams = 0; ///< dropped
    std::uint64_t challenges = 0;         ///< logins by datagram that were asked to show their address's key
    std::uint64_t strange_outcomes = 0;   ///< answers to telecommands that went elsewhere: dropped
    std::uint64_t telecommands_sent = 0;  ///< attempts
    std::uint64_t telecommands_acknowledged = 0;
    std::uint64_t telecommands_open = 0;
    link_seal seal;
    std::string day; ///< "2026-11-21", UTC
    gprs_spending today;
    gprs_spending this_month;
    link_budget budget;        ///< in bytes, both ways
    std::string budget_notice; ///< what the end of the budget means now; empty: it is not spent
};

namespace services {

inline constexpr ise::subscription<gprs_state> gprs{"gprs_state"};

} // namespace services

} // namespace atirma
