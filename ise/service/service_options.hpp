#pragma once
#include <ise/core/time.hpp>
#include <ise/wire/messages.hpp>

#include <cstddef>
#include <cstdint>

namespace ise {

/// Limits and times of a component's sessions, calls and subscriptions; of all components of a node.
struct service_options {
    wire::limits accepts; ///< what peers are told, such as the largest message and the time between heartbeats
    duration handshake_time = std::chrono::seconds(5); ///< for both sides to greet
    duration connect_time = std::chrono::seconds(5); ///< for one address
    duration first_back_off = std::chrono::milliseconds(50); ///< the pause before the second try
    duration longest_back_off = std::chrono::seconds(5); ///< the pauses double up to this
    duration reconnect_spread = std::chrono::milliseconds(500); ///< the first try after a loss comes within it, at random
    duration default_deadline = std::chrono::seconds(5); ///< of calls that give none
    duration linger = std::chrono::seconds(30);          ///< a vanished subscriber is kept, and a call over udp of a vanished client goes on, for this long
    std::size_t max_sessions = 20'000;                   ///< of other processes that have greeted; beyond, the host with most loses its oldest to one with fewer
    std::size_t max_handshakes = 256;                    ///< strangers at once; beyond, the oldest from the host with most makes way
    std::uint32_t max_calls_per_session = 4096;          ///< served at once for one peer
    std::uint32_t max_subscriptions_per_session = 1024;  ///< of one peer
    std::size_t max_unsent_bytes = 64u << 20;            ///< of calls and replies on one session; more are overloaded
    std::size_t max_subscriber_bytes = 256u << 20;       ///< packets held for one session; beyond, the policies apply as if the queues were full
    std::size_t max_lingering = 4096;                    ///< vanished subscribers of one publication; beyond, the oldest is forgotten
    duration longest_stall = std::chrono::seconds(30);   ///< a lossless subscriber that holds up its publisher is ended then
    duration longest_silence = std::chrono::seconds(1);  ///< one that is not heard meanwhile is ended then; at least one heartbeat
    /// Bytes of one session that wait behind the reach of priorities and of "keep latest", in the system's send queue and
    /// in a write that was begun, over udp all that is under way: over a slow link a packet is no older than these take to drain. Fewer cost throughput.
    std::size_t unsent_bytes = 128 * 1024;
};

} // namespace ise
