#pragma once
#include <ise/core/time.hpp>

#include <cstddef>
#include <cstdint>

namespace ise::net::udp {

/// How much may be under way, and how long an answer takes: a slow start, a halving at most once a round trip, and
/// sending at the pace of the window instead of all at once. Without I/O.
class congestion {
public:
    static constexpr std::size_t datagram = 1200;
    static constexpr std::size_t first_window = 10 * datagram;
    static constexpr std::size_t min_window = 2 * datagram;
    /// Kernels' default buffers hold about this much of datagrams of this size.
    static constexpr std::size_t max_window = 96 * datagram;
    /// So many leave at once; more go at the pace.
    static constexpr std::size_t burst = 10 * datagram;

    /// What is delayed by the receiver on purpose is no travel.
    void sample(duration round_trip, duration delayed_there) noexcept;
    void on_sent(std::size_t bytes, time_point now) noexcept;
    void on_acked(std::size_t bytes, bool window_was_used) noexcept;
    /// `number`: of the lost datagram; `next`: of the next one to be sent.
    void on_lost(std::size_t bytes, std::uint64_t number, std::uint64_t next) noexcept;
    /// What was sent is not waited for any more, which says nothing about the network.
    void forget(std::size_t bytes) noexcept { in_flight_ -= bytes < in_flight_ ? bytes : in_flight_; }
    /// From now on at most about this much is under way: on a slow way that stores all, the rest would age there.
    void limit(std::size_t most) noexcept;
    /// Nothing was heard for several time-outs.
    void collapse() noexcept { window_ = min_window; }

    bool window_open() const noexcept { return in_flight_ + datagram <= window_; }
    /// When the pace allows the next one; a time that has passed: now.
    time_point paced_until(time_point now) noexcept;

    std::size_t window() const noexcept { return window_; }
    std::size_t in_flight() const noexcept { return in_flight_; }
    duration round_trip() const noexcept { return smoothed_; }
    bool measured() const noexcept { return smoothed_ > duration{}; }
    /// How long nothing may be heard before something is sent again.
    duration time_out() const noexcept;
    /// A datagram of which later ones have arrived is lost when it is older than this.
    duration reordering() const noexcept;

private:
    std::size_t window_ = first_window;
    std::size_t most_ = max_window; // of the window
    std::size_t threshold_ = max_window;
    std::size_t in_flight_ = 0;
    std::uint64_t recovering_until_ = 0; // losses of what was sent before are one event
    duration smoothed_{};
    duration deviation_{};
    duration latest_{};
    double budget_ = burst;
    time_point budget_at_{};
};

} // namespace ise::net::udp
