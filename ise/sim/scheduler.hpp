#pragma once
#include <ise/core/time.hpp>
#include <ise/sim/flow.hpp>

#include <asio/io_context.hpp>

#include <deque>
#include <map>
#include <stdexcept>
#include <thread>

namespace ise::sim {

/// The world did not come to rest within its bound of events; the message names what is busy.
class stuck : public std::runtime_error {
    using std::runtime_error::runtime_error;
};

/// The engine of the virtual world: one thread, a queue of what is ready and one of what has a time. Equal
/// times run in the order in which they were asked for.
class scheduler {
public:
    /// What names an event that has a time, for `cancel`.
    struct ticket {
        time_point at{};
        std::uint64_t order = 0; ///< 0: none
    };

    struct bounds {
        std::uint64_t events_at_one_time = 1'000'000; ///< without the clock moving: a livelock
        std::uint64_t events_in_one_run = 200'000'000;
    };

    explicit scheduler(time_point start) : now_(start) {}
    ~scheduler();
    /// Everything is destroyed unrun; flows and executors that outlive it are harmless.
    void drop_all();

    time_point now() const noexcept { return now_; }
    asio::io_context& context() noexcept { return context_; }
    bool running_here() const noexcept { return depth_ > 0 && std::this_thread::get_id() == thread_; }
    const flow* current() const noexcept { return current_; }

    std::shared_ptr<flow> make_flow(std::string name);
    void submit(const std::shared_ptr<flow>& into, work what);
    /// Nothing of the flow runs any more and what it had to run is destroyed, before this returns.
    void kill(flow& which);
    /// Destroys what was handed to dead flows since, such as the frames of coroutines that wait no more.
    void bury();
    void pause(flow& which) noexcept { which.paused = true; }
    void go_on(const std::shared_ptr<flow>& which);

    /// Runs `what` at a time, or next if that has passed; in `where`, or belonging to nobody.
    ticket at(time_point when, std::shared_ptr<flow> where, work what);
    void cancel(ticket& which) noexcept;
    /// Runs `what` as soon as no event is being run: at once where none is.
    void when_outside(work what);

    /// A run: what follows is counted against the bounds anew.
    void begin_run();
    /// Runs one event, the clock jumping to it where nothing is ready. False: nothing is left until `limit`.
    bool step(time_point limit);
    /// Moves the clock without running anything.
    void advance_to(time_point when) noexcept { now_ = std::max(now_, when); }
    bool idle() const noexcept { return ready_.empty() && timed_.empty(); }
    /// What is ready, held for paused flows, or has a time: timers, waits with a deadline, what is under way.
    std::size_t waiting() const noexcept { return ready_.size() + timed_.size() + held_.size(); }

    bounds limits;

private:
    struct entry {
        std::shared_ptr<flow> where;
        work what;
    };
    using time_key = std::pair<time_point, std::uint64_t>;

    std::size_t run_one_of_context();
    void run(entry next);
    void count(const flow* where);
    [[noreturn]] void give_up(const char* why) const;

    asio::io_context context_; // destroyed last
    std::vector<std::shared_ptr<flow>> flows_;
    std::deque<entry> ready_;
    std::map<time_key, entry> timed_;
    std::deque<entry> held_; // of paused flows
    std::deque<work> dead_;  // to be destroyed
    std::deque<work> outside_;
    time_point now_;
    std::uint64_t order_ = 0;
    std::uint64_t events_in_run_ = 0, events_at_now_ = 0, ownerless_ = 0;
    time_point counted_at_{};
    flow* current_ = nullptr;
    int depth_ = 0;
    bool burying_ = false;
    std::thread::id thread_;
};

} // namespace ise::sim
