#pragma once
#include <ise/core/asio_names.hpp>
#include <ise/core/environment.hpp>
#include <ise/core/suspended.hpp>
#include <ise/core/time.hpp>
#include <ise/core/unique_function.hpp>

#include <algorithm>
#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <utility>
#include <vector>

namespace ise {

/// Runs functions on a loop from other threads (`component::on().gate()`). It may outlive the loop; it is closed then.
class loop_gate : public std::enable_shared_from_this<loop_gate> {
public:
    /// Made by `loop::gate`.
    explicit loop_gate(loop& owner) : loop_(&owner) {}

    /// Runs `work` in a later iteration of the loop. Returns false and drops `work` if the loop has ended. Accepted
    /// work is dropped if the loop ends first. Thread-safe; does not wait.
    bool post(unique_function<void()> work);

private:
    friend class loop;
    void shut() noexcept;

    std::mutex mutex_; // while something is posted: the executor lives as long as the loop
    std::atomic<loop*> loop_;
};

/// Wakes a loop at a given time: an Asio timer, or the virtual clock.
class alarm {
public:
    virtual ~alarm() = default;
    /// Calls `loop::on_alarm()` on the loop's executor at or after `at`. A later call replaces an earlier one.
    virtual void arm(time_point at) = 0;
};

/// Where something may come of which the system tells nothing: memory that another process writes to.
class unannounced {
public:
    /// On the loop, outside of turns. Hands over what has come, in a turn; true: it need not be looked at again.
    virtual bool look() = 0;
    /// Nobody looks any more. Runs nothing of others.
    virtual void rest() = 0;

protected:
    ~unannounced() = default;
};

/// What wants to know that a loop has something to do: a real one may look for what follows instead of sleeping.
class idle_watcher {
public:
    virtual ~idle_watcher() = default;
    /// A turn begins, at `now`. On the loop.
    virtual void on_turn(time_point now) = 0;
    /// Looks at `what`, too, until that or `forget` ends it. False: it does not look now.
    virtual bool look_at(unannounced& what) = 0;
    virtual void forget(unannounced& what) noexcept = 0;
};

/// Calls a function at a given time. Belongs to one loop and is used on it only; destroying it disarms it.
class timer {
public:
    timer(loop& owner, std::function<void()> fire);
    ~timer();
    timer(const timer&) = delete;
    timer& operator=(const timer&) = delete;

    /// Arms it, or changes its time. If the time has passed, it fires in the next turn, never inside this call.
    void arm(time_point at);
    void disarm() noexcept { armed_ = false; }
    bool armed() const noexcept { return armed_; }
    time_point at() const noexcept { return at_; }

private:
    friend class loop;
    static constexpr std::size_t unlisted = static_cast<std::size_t>(-1);

    loop& loop_;
    std::function<void()> fire_;
    time_point at_{};
    std::uint64_t order_ = 0; // timers of one instant fire as they were armed
    // Where the loop lists it: under its time, or an earlier one that it had before.
    time_point listed_at_{};
    std::uint64_t listed_order_ = 0;
    std::size_t slot_ = unlisted;
    bool armed_ = false;
};

/// Whatever has bytes to write, or to hand over, once the turn is over. Leaves its loop's list when it is destroyed.
class flushable {
public:
    flushable() = default;
    flushable(const flushable&) = delete;
    flushable& operator=(const flushable&) = delete;

    virtual void flush() = 0;
    /// Whether it is going to be flushed anyway.
    bool flush_due() const noexcept { return entry_.listed(); }

protected:
    ~flushable() = default;

private:
    friend class loop;

    /// A place in a list, or its head.
    struct entry {
        explicit entry(flushable* whose) noexcept : of(whose) {}
        entry(const entry&) = delete;
        entry& operator=(const entry&) = delete;
        ~entry() { leave(); }

        bool listed() const noexcept { return next != this; }
        void push_back(entry& last) noexcept {
            last.previous = previous;
            last.next = this;
            previous->next = &last;
            previous = &last;
        }
        void leave() noexcept {
            previous->next = next;
            next->previous = previous;
            previous = next = this;
        }

        flushable* const of; // null: the head
        entry* previous = this;
        entry* next = this;
    };

    entry entry_{this};
    std::shared_ptr<flushable> held_; // while it is listed, by whoever asked for that
};

/// The event loop of one or several components and their connections: an executor on which nothing runs
/// concurrently, its clock and its timers.
///
/// Work is done in **turns**: a turn begins when bytes or a timer arrive, and at its end the coroutines that
/// became ready are resumed and then everything that was written is flushed. So related data
/// leave in one system call, and coroutines are never resumed from within a data structure that changes.
class loop {
public:
    using executor_type = asio::any_io_executor;

    loop(environment& environment, const executor_type& executor, std::function<bool()> running_here);
    ~loop();
    loop(const loop&) = delete;
    loop& operator=(const loop&) = delete;

    void use_alarm(std::unique_ptr<alarm> wake) { alarm_ = std::move(wake); }
    void on_alarm();
    /// Outlives the loop, or is taken off again by a null.
    void use_watcher(idle_watcher* watcher) noexcept { watcher_ = watcher; }

    /// Looks at `what` again and again instead of sleeping. False: this loop does not do so now. On the loop only.
    bool look_at(unannounced& what) { return watcher_ && watcher_->look_at(what); }
    void forget(unannounced& what) noexcept {
        if (watcher_) watcher_->forget(what);
    }

    const executor_type& get_executor() const noexcept { return *executor_; }
    ise::environment& env() noexcept { return environment_; }

    /// Monotonic time; read once per turn, and anew outside of turns.
    time_point now() const { return depth_ > 0 ? turn_time_ : environment_.now(); }

    /// The same to some milliseconds, however long this turn has lasted: for whatever must not begin too late.
    time_point fresh_now() {
        const bool lasts = depth_ > 0 && environment_.recently() > turn_time_;
        if (lasts) turn_time_ = std::max(turn_time_, environment_.now());
        return now();
    }

    /// Whether the calling thread is running this loop.
    bool running_here() const { return running_here_(); }

    /// Runs `ready` at the end of the present turn, or soon where there is none. On the loop only.
    template <class Ready>
    void later(Ready&& ready) {
        if (abandoned_) return;
        ready_.emplace_back(std::forward<Ready>(ready));
        if (depth_ == 0) post_turn();
    }
    /// Flushes at the end of the present turn. Outside of turns: at once, and what follows before the loop
    /// comes round again is gathered. On the loop only.
    void flush_later(flushable& output);
    /// The same, and holds it until then.
    void flush_later(std::shared_ptr<flushable> output);
    /// The same at the end of the present turn, or soon where there is none: never within this call.
    void flush_soon(flushable& output);

    bool in_turn() const noexcept { return depth_ > 0; }

    /// What those who live on the loop have in common: one T, made when the first of them asks, which goes with the
    /// loop.
    template <class T>
    T& common() {
        static constexpr char key = 0; // its address
        for (auto& [other, what] : common_)
            if (other == &key) return *static_cast<T*>(what.get());
        return *static_cast<T*>(common_.emplace_back(&key, std::make_shared<T>()).second.get());
    }

    /// Opens a turn as long as it lives; the outermost one ends it.
    class turn {
    public:
        explicit turn(loop& owner);
        ~turn();
        turn(const turn&) = delete;
        turn& operator=(const turn&) = delete;

    private:
        loop& loop_;
    };

    std::size_t armed_timers() const noexcept;

    /// The way in for other threads, which may keep it for longer than the loop lives.
    const std::shared_ptr<loop_gate>& gate() const noexcept { return gate_; }

    /// Ends the loop: nothing of it runs any more, and what is suspended on it is destroyed instead of resumed
    /// (a coroutine's frame through the executor, which must run once more, or drop what it holds, while
    /// everything that the frames refer to still lives). Timers are disarmed; later waits are dropped at once.
    /// The destructor does the same.
    void abandon() noexcept;
    bool abandoned() const noexcept { return abandoned_; }

    /// For what waits on the loop (`waiter`): listed while it does.
    void enlist(suspended& entry) noexcept;
    void delist(suspended& entry) noexcept;

private:
    friend class timer;
    void insert(timer& entry);
    void remove(timer& entry) noexcept;
    void sift_up(std::size_t slot) noexcept;
    void sift_down(std::size_t slot) noexcept;
    static bool before(const timer& a, const timer& b) noexcept;
    void wake_for_first();
    void end_turn();
    void flush_first();
    void post_turn();

    environment& environment_;
    std::unique_ptr<const executor_type> executor_;
    std::function<bool()> running_here_;
    std::unique_ptr<alarm> alarm_;
    idle_watcher* watcher_ = nullptr;
    std::vector<timer*> heap_;
    std::vector<unique_function<void()>> ready_, spare_ready_;
    flushable::entry outputs_{nullptr};
    time_point turn_time_{};
    time_point alarm_at_ = time_point::max();
    std::uint64_t armed_count_ = 0;
    int depth_ = 0;
    bool turn_posted_ = false;
    bool abandoned_ = false;
    suspended* suspended_ = nullptr;
    std::vector<std::pair<const void*, std::shared_ptr<void>>> common_;
    std::shared_ptr<loop_gate> gate_;
    std::shared_ptr<bool> alive_ = std::make_shared<bool>(true); // posted turns look at it
};

} // namespace ise
