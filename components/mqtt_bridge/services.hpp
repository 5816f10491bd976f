#pragma once
#include <ise/session/contract.hpp>

#include <cstdint>
#include <string>

/// The services of the bridge itself.
namespace ise::mqtt {

/// Asks for `bridge_status`.
struct status_request {};
/// How the bridge is; counts since it began.
struct bridge_status {
    std::string broker;             ///< "mqtt://127.0.0.1:1883"
    bool connected = false;         ///< now
    std::string trouble;            ///< why not, or what was last refused; empty: nothing
    std::uint64_t connections = 0;  ///< made
    std::uint32_t topics = 0;       ///< of services that are subscribed to, now
    std::uint64_t messages = 0;     ///< the broker has confirmed
    std::uint64_t replaced = 0;     ///< of services of which the latest counts: by a newer one before it was sent
    std::uint64_t queued = 0;       ///< wait for the broker, now
    std::uint64_t queued_bytes = 0; ///< of these on disk, now
    std::uint64_t history = 0;      ///< messages that were sent after they had waited for a connection
    std::uint64_t resent = 0;  ///< messages sent again, as the broker did not confirm them before the connection ended
    std::uint64_t dropped = 0; ///< the oldest of the queue, or those that neither disk nor memory had room for
    std::uint64_t gaps = 0;    ///< packets of queued services that the bridge itself did not get
    std::uint64_t refused = 0; ///< messages that the broker refused
    std::uint64_t calls = 0;   ///< made for MQTT clients
    std::uint64_t calls_failed = 0;  ///< of these
    std::uint64_t calls_again = 0;   ///< requests that came again and were not executed again
    std::uint64_t published = 0;     ///< messages of MQTT clients that were published in ISE
    std::uint64_t not_published = 0; ///< messages and requests of MQTT clients that were refused without an answer
};
/// How the bridge is.
inline constexpr request_response<status_request, bridge_status> status_service{"status"};

} // namespace ise::mqtt
