#pragma once
#include <ise/session/contract.hpp>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

// The emulated gateway: what modems ask of it, and what tests and demonstrations change of it.
namespace atirma {

/// A session of a modem: its message, or only a look for mail.
struct sbd_session_request {
    std::string imei;
    std::uint16_t momsn = 0;
    std::vector<std::byte> data;      ///< ≤ 340 bytes; empty: a look for mail
    std::uint16_t received_mtmsn = 0; ///< the last message that the modem got whole, which is forgotten then; or 0
};
struct sbd_session_reply {
    std::uint8_t mo_status = 0; ///< as +SBDIX tells: 0 taken
    std::uint8_t mt_status = 0; ///< 0 nothing waits, 1 `data` is a message
    std::uint16_t mtmsn = 0;
    std::vector<std::byte> data;
    std::uint16_t mt_queued = 0; ///< that wait still
};

/// A message came for a modem.
struct sbd_ring_alert {
    std::string imei;
};

/// Changes the gateway; what is missing stays. An empty one only asks.
struct iridium_gateway_request {
    std::optional<bool> up;                 ///< false: no session, no post, no submission works
    std::optional<double> session_failures; ///< part of the sessions that fail, 0 … 1
    std::optional<double> duplicates;       ///< part of the deliveries that are made twice although they were taken
    std::optional<double> delivery_delay_s; ///< mean, from a session to its first post, 0 … 3600
    std::optional<int> fail_mt;             ///< RockBLOCK's code that every submission is answered with; 0: none
    std::optional<bool> flush;              ///< true: drops the messages that wait for modems
};
struct iridium_gateway_state {
    bool up = true;
    double session_failures = 0;
    double duplicates = 0;
    double delivery_delay_s = 0;
    int fail_mt = 0;
    std::uint64_t sessions = 0;
    std::uint64_t sessions_failed = 0;
    std::uint64_t mo_messages = 0;
    std::uint64_t mo_waiting = 0; ///< that nobody has taken yet
    std::uint64_t posts = 0;
    std::uint64_t posts_failed = 0; ///< not answered 200 in time: made again
    std::uint64_t mo_given_up = 0;  ///< after twelve hours
    std::uint64_t mt_messages = 0;  ///< taken from the shore
    std::uint64_t mt_refused = 0;
    std::uint64_t mt_waiting = 0;
    std::uint64_t mt_delivered = 0;
    std::string trouble; ///< why the last delivery failed
};

namespace services {

/// Errors: refused (an IMEI that is none, a message too long), not_connected (it is down).
inline constexpr ise::request_response<sbd_session_request, sbd_session_reply> sbd_session{"sbd_session"};
inline constexpr ise::subscription<sbd_ring_alert> sbd_ring{"sbd_ring"};
/// Errors: refused (a number out of range).
inline constexpr ise::request_response<iridium_gateway_request, iridium_gateway_state> iridium_gateway_control{
    "iridium_gateway_control"};
inline constexpr ise::subscription<iridium_gateway_state> iridium_gateway_status{"iridium_gateway_status"};

} // namespace services

} // namespace atirma
