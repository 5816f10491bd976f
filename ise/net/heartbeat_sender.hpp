#pragma once
#include <ise/core/stream.hpp>
#include <ise/core/time.hpp>

#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <vector>

namespace ise::net {

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
    /// The shortest heartbeat that any peer ever wanted; duration::max() before the first.
    duration min_heartbeat() const noexcept { return duration(shortest_.load(std::memory_order_relaxed)); }

private:
    std::function<void()> on_shorter_;
    std::mutex mutex_;
    std::vector<std::weak_ptr<heartbeat_sender>> all_;
    std::size_t pruned_at_ = 64;
    std::atomic<duration::rep> shortest_{duration::max().count()};
};

} // namespace ise::net
