#pragma once
#include <ise/core/time.hpp>
#include <ise/sim/random.hpp>

#include <array>
#include <cstddef>
#include <string>

namespace ise::sim {

/// The network link between two hosts (or within one), the same in both directions. Members can be set at any time;
/// packets in transit keep their time of arrival.
struct link {
    duration latency = std::chrono::microseconds(500); ///< one way
    duration jitter{};                                 ///< added to it, 0 <= x < jitter; never reorders a stream
    double loss = 0;      ///< of a packet, 0..1. A stream retransmits: there a loss is a delay
    double duplicate = 0; ///< of a datagram, 0..1
    double reorder = 0;   ///< of a datagram, 0..1: it is held back by up to `reorder_delay`
    duration reorder_delay = std::chrono::milliseconds(20); ///< at most
    std::uint64_t bandwidth_bytes_per_second = 0; ///< in each direction, shared by all connections; 0: unlimited
    std::size_t send_buffer_bytes = 64 * 1024;    ///< of a stream: bytes in transit
    std::size_t receive_buffer_bytes = 64 * 1024; ///< of a new stream: bytes received and not read
    std::size_t datagram_limit_bytes = 65'507;    ///< a longer datagram is an error for its sender
    duration datagram_queue = std::chrono::milliseconds(500); ///< of waiting for bandwidth; beyond: dropped

    /// By `network::partition`.
    bool partitioned() const noexcept { return partitioned_; }

    /// @cond
    // For the world's parts: draws of this link's own.
    bool random_loss() noexcept { return random_.chance(loss); }
    bool random_duplicate() noexcept { return random_.chance(duplicate); }
    duration random_reordering() noexcept {
        if (!random_.chance(reorder)) return {};
        return duration(
            static_cast<duration::rep>(random_.below(static_cast<std::uint64_t>(reorder_delay.count())) + 1));
    }
    /// @endcond

private:
    friend class network;
    explicit link(generator random) : random_(random) {}

    generator random_;
    bool partitioned_ = false;
    std::array<time_point, 2> free_at_{}; // of each direction's transmitter
};

} // namespace ise::sim
