#pragma once
#include <ise/core/time.hpp>
#include <ise/wire/messages.hpp>

#include <cstddef>
#include <cstdint>

namespace ise {

/// Limits and timeouts of the sessions, calls and subscriptions of all components of a node.
struct service_options {
    wire::limits accepts; ///< limits announced to peers, such as the largest message and the heartbeat period
    duration handshake_time = std::chrono::seconds(5);       ///< for the whole handshake
    duration connect_time = std::chrono::seconds(5);         ///< for connecting to one address
    duration first_back_off = std::chrono::milliseconds(50); ///< the pause before the second attempt
    duration max_back_off = std::chrono::seconds(5);         ///< the pauses double up to this
    duration reconnect_spread =
        std::chrono::milliseconds(500); ///< the first attempt after a loss is at a random time within it
    duration default_deadline = std::chrono::seconds(5); ///< for calls without a deadline
    duration linger = std::chrono::seconds(
        30); ///< how long a vanished subscriber is kept, and a udp call of a vanished client continues
    /// With other processes, after the handshake; beyond, the host with the most loses its oldest to one with fewer.
    std::size_t max_sessions = 20'000;
    std::size_t max_handshakes = 256;           ///< pending handshakes; beyond, the host with the most loses its oldest
    std::uint32_t max_calls_per_session = 4096; ///< running at once for one peer
    std::uint32_t max_subscriptions_per_session = 1024; ///< of one peer
    std::size_t max_unsent_bytes =
        64u << 20; ///< calls and replies queued on one session; more are refused as overloaded
    std::size_t max_subscriber_bytes =
        256u << 20; ///< packets queued for one session; beyond, the policies apply as if the queues were full
    std::size_t max_lingering = 4096; ///< vanished subscribers of one publication; beyond, the oldest is forgotten
    duration max_stall =
        std::chrono::seconds(30); ///< the subscription of a lossless subscriber that holds up its publisher ends then
    duration max_silence = std::chrono::seconds(1); ///< the same for one that is silent; at least one heartbeat
    /// Bytes of one session that wait behind the reach of priorities and of "keep latest", in the system's send queue
    /// and in a write that was begun, over udp all that is under way: over a slow link a packet is no older than these
    /// take to drain. Fewer cost throughput.
    std::size_t unsent_bytes = 128 * 1024;
};

} // namespace ise
