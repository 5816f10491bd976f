#pragma once
#include <ise/core/stream.hpp>
#include <ise/core/time.hpp>

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <vector>

namespace ise::net {

/// When each side of a connection was heard last: whether the peer is lost, and whether it is to be sent a ping.
/// Decides by the times that it is told, without I/O.
class liveness {
public:
    /// `ours`: the period in which the peer promised to be heard.
    liveness(duration ours, time_point now) noexcept : ours_(ours), heard_(now), sent_(now) {}

    struct verdict {
        bool lost = false;       ///< the peer was silent for three periods
        bool ping = false;       ///< it counts as sent
        time_point look_again{}; ///< unless it is lost
    };
    /// Looks at the connection. `theirs`: the period in which the peer wants to hear something.
    verdict look(time_point now, duration theirs) noexcept;

    void heard(time_point now) noexcept { heard_ = now; }
    void sent(time_point now) noexcept { sent_ = now; }
    /// A ping of that time was answered.
    void answered(duration took) noexcept { round_trip_ = took; }

    time_point last_heard() const noexcept { return heard_; }
    time_point last_sent() const noexcept { return sent_; }
    /// The last one that was measured; zero before the first.
    duration round_trip() const noexcept { return round_trip_; }

private:
    duration ours_;
    time_point heard_;
    time_point sent_;
    time_point pinged_{};
    time_point due_{}; // of the next look
    duration round_trip_{};
};

/// What is known of a peer's monotonic clock: bounds of how far it is ahead of ours, which each round trip of a
/// heartbeat narrows and which widen with time, as clocks drift. Pure.
class peer_clock {
public:
    /// Two clocks part by no more than one part in so many (500 ppm).
    static constexpr int steadiness = 2000;

    /// It is the clock of this process.
    void is_ours() noexcept { known_ = same_ = true; }
    bool known() const noexcept { return known_; }

    /// The peer's clock read `theirs` at some moment between `sent` and `came` of ours. A reading that contradicts
    /// those before (one machine was suspended) counts alone.
    void note(time_point sent, time_point theirs, time_point came) noexcept {
        if (same_ || came < sent || !plausible(theirs)) return;
        const auto low = theirs - came, high = theirs - sent;
        const auto drift = (came - taken_) / steadiness;
        const bool fits = known_ && low <= high_ + drift && high >= low_ - drift;
        low_ = fits ? std::max(low, low_ - drift) : low;
        high_ = fits ? std::min(high, high_ + drift) : high;
        taken_ = came;
        known_ = true;
    }

    /// How far a time of ours may be off at the peer, to either side.
    duration uncertainty(time_point now) const noexcept {
        return same_ ? duration{} : (high_ - low_) / 2 + (now - taken_) / steadiness;
    }

    /// Added to a deadline by our clock, it gives one by the peer's: not later, and by up to twice the
    /// uncertainty earlier. That is a round trip: of a deadline that is closer no answer would come in time.
    duration ahead(time_point now) const noexcept { return (low_ + high_) / 2 - uncertainty(now); }

private:
    // A peer may say anything: within these bounds nothing overflows.
    static constexpr bool plausible(time_point theirs) noexcept {
        constexpr auto most = duration(std::int64_t{1} << 61); // 73 years
        return theirs.time_since_epoch() < most && theirs.time_since_epoch() > -most;
    }

    duration low_{}, high_{};
    time_point taken_{};
    bool known_ = false;
    bool same_ = false;
};

class datagram_stream;

/// The right to write on one connection, passed between its loop and one other thread, which shows the peer a sign of
/// life while that loop does not turn (its component computes for long). Whoever writes has claimed it; the connection
/// keeps it while a frame is half written, so that a sign always lies between frames.
///
/// Lifetime: the transport outlives it until `end()` has returned; both sides share it.
class heartbeat_sender {
public:
    /// `heartbeat`: how often the peer wants to hear something.
    heartbeat_sender(stream& transport, duration heartbeat, time_point now);

    // For the connection, on its loop.

    /// Before anything is written; nothing if it is held already. Waits at most for one small non-blocking write.
    void claim() noexcept {
        if (!held_ && !on_one_loop_) wait_for_claim();
        held_ = true;
    }
    /// Between frames. `sent`: when the peer was sent something last.
    void release(time_point sent) noexcept;
    /// After this the transport is not touched any more.
    void end() noexcept { claim(); }
    /// From now on four times as often: the peer waits for this side.
    void quicken() noexcept { heartbeat_.store(full_heartbeat_.count() / 4, std::memory_order_relaxed); }
    /// A sign went only in part, so that nothing can follow it. While it is held.
    bool broken() const noexcept { return broken_; }

    // For the other thread.

    /// Sends a pong that says *stalled*, where the peer should have been sent something long since and nothing is half
    /// written. Never waits.
    void show(time_point now);
    duration heartbeat() const noexcept { return duration(heartbeat_.load(std::memory_order_relaxed)); }

private:
    void wait_for_claim() noexcept;

    stream& transport_;
    datagram_stream* const datagrams_; // the same, where it is one: there a sign is a datagram of its own
    const duration full_heartbeat_;
    std::atomic<duration::rep> heartbeat_;
    std::atomic<duration::rep> sent_;
    std::atomic<bool> claimed_{false};
    bool on_one_loop_ = false; // the peer waits for the same loop, and nobody else may touch the stream
    bool held_ = false;        // by the connection
    bool broken_ = false;      // changed while it is claimed
};

/// Those of all connections of one component. Thread-safe.
class heartbeat_senders {
public:
    /// `told` is called, on the thread that adds, when a peer wants to hear something sooner than all before it. Set
    /// before anything is added.
    void on_shorter(std::function<void()> result) { on_shorter_ = std::move(result); }
    void add(const std::shared_ptr<heartbeat_sender>& made);
    /// One of them is to send this often.
    void hasten(duration heartbeat);
    void show(time_point now);
    /// The shortest heartbeat that any peer wants, as of the last `show`; duration::max() where there is none.
    duration min_heartbeat() const noexcept { return duration(shortest_.load(std::memory_order_relaxed)); }

private:
    std::function<void()> on_shorter_;
    std::mutex mutex_;
    std::vector<std::weak_ptr<heartbeat_sender>> all_;
    std::size_t pruned_at_ = 64;
    std::atomic<duration::rep> shortest_{duration::max().count()};
};

} // namespace ise::net
