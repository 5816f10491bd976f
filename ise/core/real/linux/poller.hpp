#pragma once
#include <ise/core/loop.hpp>
#include <ise/core/real/linux/poll_policy.hpp>

#include <asio/any_io_executor.hpp>

#include <atomic>
#include <memory>
#include <vector>

namespace ise::real {

/// The loops of a process that may look for events at the same time: no more than it has cores.
class poll_seats {
public:
    bool take() noexcept;
    void give_back() noexcept { taken_.fetch_sub(1, std::memory_order_relaxed); }

private:
    std::atomic<int> taken_{0};
};

/// Keeps the thread of a loop from sleeping while that pays (`poll_policy`): as long as work is queued, the loop asks
/// the system for events without waiting.
///
/// Lifetime: outlives what it posts. Used on the loop's thread, or when that has ended.
class poller final : public idle_watcher {
public:
    /// `on` is the executor of one thread.
    poller(environment& world, asio::any_io_executor on, duration window, std::shared_ptr<poll_seats> seats);
    ~poller() override;

    void on_turn(time_point now) override;
    bool look_at(unannounced& what) override;
    void forget(unannounced& what) noexcept override;
    /// For good.
    void stop() noexcept;

private:
    void post_look();
    void look();
    bool look_around();
    void leave() noexcept;
    bool preempted() noexcept;

    environment& world_;
    asio::any_io_executor on_;
    poll_policy policy_;
    std::shared_ptr<poll_seats> seats_;
    std::vector<unannounced*> around_; // null: forgotten meanwhile
    long preemptions_ = 0;             // of this thread, when last counted
    bool seated_ = false;
    bool queued_ = false;
    bool stopped_ = false;
};

} // namespace ise::real
