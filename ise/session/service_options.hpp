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
    /// How long subscriptions, udp calls and runs of actions of a disconnected peer are kept.
    duration linger = std::chrono::seconds(30);
    /// A lossless subscription that blocks `publication::send` for this long ends.
    duration max_stall = std::chrono::seconds(30);
    /// The same for a subscriber without heartbeats; at least one heartbeat period.
    duration max_silence = std::chrono::seconds(1);

    /// Sessions with other processes, after the handshake. Beyond, the host with the most sessions loses its oldest one
    /// to a host with fewer.
    std::size_t max_sessions = 20'000;
    std::size_t max_handshakes = 256;                   ///< pending; beyond, the host with the most loses its oldest
    std::uint32_t max_calls_per_session = 4096;         ///< running at once for one peer
    std::uint32_t max_subscriptions_per_session = 1024; ///< of one peer
    std::size_t max_lingering = 4096; ///< disconnected subscribers of a publication; beyond, the oldest is dropped

    /// Memory budget of one session: calls and replies that the peer has not read, and the schemas that the peer sends.
    /// Beyond it: errc::overloaded. The other buffers of a session are bounded by a share of it. Default: 64 MiB.
    std::size_t session_bytes = std::size_t{64} << 20;
    /// Memory budget of the replies of all sessions of one host.
    std::size_t host_bytes() const noexcept { return 4 * session_bytes; }
    /// Memory budget of incompletely received messages from all sessions of one host.
    std::uint64_t unfinished_bytes() const noexcept {
        return std::max<std::uint64_t>(host_bytes(), 2 * accepts.max_message_bytes);
    }
    /// Memory budget of published packets that wait to be sent; beyond, the policies apply as if the queues were full.
    std::size_t queued_bytes() const noexcept { return 4 * session_bytes; }
    /// Memory budget of packets that wait for the comparison of schemas.
    std::size_t held_bytes() const noexcept { return session_bytes / 4; }

    /// Bytes of one session that the kernel already has (UDP: in flight), where priorities and `keep_latest` no longer
    /// apply. Smaller values reduce latency on slow links and cost throughput. Default: 128 KiB.
    std::size_t unsent_bytes = 128 * 1024;

    /// Receives call spans; null disables tracing. Set by the node (`node_options::traces`).
    std::shared_ptr<tracer> traces;
};

} // namespace ise
