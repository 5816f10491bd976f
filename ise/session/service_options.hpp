#pragma once
#include <ise/core/time.hpp>
#include <ise/wire/messages.hpp>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>

namespace ise {

class tracer;

/// Limits and timeouts of the sessions, calls and subscriptions of all components of a node.
struct service_options {
    wire::limits accepts; ///< limits announced to peers, such as the largest message and the heartbeat period

    duration connect_time = std::chrono::seconds(5); ///< for connecting to one address; the same for a handshake
    duration first_back_off = std::chrono::milliseconds(50); ///< the pause before the second attempt
    /// The pauses double up to this. After a loss the first attempt is made at a random time within a tenth of it.
    duration max_back_off = std::chrono::seconds(5);
    duration default_deadline = std::chrono::seconds(5); ///< for calls without a deadline
    /// How long a vanished subscriber is kept, and a udp call of a vanished client continues.
    duration linger = std::chrono::seconds(30);
    /// The subscription of a lossless subscriber that holds up its publisher for this long ends.
    duration max_stall = std::chrono::seconds(30);
    /// The same for one that is silent; at least one heartbeat.
    duration max_silence = std::chrono::seconds(1);

    /// With other processes, after the handshake; beyond, the host with the most loses its oldest to one with fewer.
    std::size_t max_sessions = 20'000;
    std::size_t max_handshakes = 256;           ///< pending ones; beyond, the host with the most loses its oldest
    std::uint32_t max_calls_per_session = 4096; ///< running at once for one peer
    std::uint32_t max_subscriptions_per_session = 1024; ///< of one peer
    std::size_t max_lingering = 4096; ///< vanished subscribers of one publication; beyond, the oldest is forgotten

    /// The memory that one session may take: for calls and replies that the peer does not read (more are refused as
    /// overloaded), and for the schemas that it tells of. What else a session holds is bounded by a share of it.
    std::size_t session_bytes = std::size_t{64} << 20;
    /// The same for the replies of all sessions of one host together.
    std::size_t host_bytes() const noexcept { return 4 * session_bytes; }
    /// The same for messages in pieces, of which some are missing, from all sessions of one host.
    std::uint64_t unfinished_bytes() const noexcept {
        return std::max<std::uint64_t>(host_bytes(), 2 * accepts.max_message_bytes);
    }
    /// Published packets that wait to be sent; beyond, the policies apply as if the queues were full.
    std::size_t queued_bytes() const noexcept { return 4 * session_bytes; }
    /// Packets that wait until schemas have been compared.
    std::size_t held_bytes() const noexcept { return session_bytes / 4; }

    /// Bytes of one session that wait behind the reach of priorities and of "keep latest", in the system's send queue
    /// and in a write that was begun, over udp all that is under way: over a slow link a packet is no older than these
    /// take to drain. Fewer cost throughput.
    std::size_t unsent_bytes = 128 * 1024;

    /// Takes the spans of calls; null: none are made. Set by the node (`node_options::traces`).
    std::shared_ptr<tracer> traces;
};

} // namespace ise
