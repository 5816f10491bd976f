#include <ise/sim/scheduler.hpp>

#include <fmt/format.h>

#include <algorithm>

namespace ise::sim {

void submit(const std::shared_ptr<flow>& into, work what) {
    if (into->owner) into->owner->submit(into, std::move(what));
}

bool running_in(const flow& which) noexcept {
    return which.alive && which.owner && which.owner->running_here() && which.owner->current() == &which;
}

scheduler::~scheduler() { drop_all(); }

void scheduler::drop_all() {
    for (auto& each : flows_) each->alive = false;
    // Dropping may submit more, which goes to the dead.
    while (!ready_.empty() || !timed_.empty() || !held_.empty() || !outside_.empty() || !dead_.empty()) {
        { auto dropped = std::exchange(ready_, {}); }
        { auto dropped = std::exchange(timed_, {}); }
        { auto dropped = std::exchange(held_, {}); }
        { auto dropped = std::exchange(outside_, {}); }
        bury();
    }
    // What the program spawned on the io_context itself is unwound through it, while the queues still stand.
    for (int round = 0; round < 1000 && run_one_of_context() > 0; ++round) bury();
    for (auto& each : flows_) each->owner = nullptr;
    flows_.clear();
}

std::shared_ptr<flow> scheduler::make_flow(std::string name) {
    std::erase_if(flows_, [](const auto& each) { return !each->alive && each.use_count() == 1; });
    auto made = std::make_shared<flow>();
    made->owner = this;
    made->context = &context_;
    made->name = std::move(name);
    flows_.push_back(made);
    return made;
}

void scheduler::submit(const std::shared_ptr<flow>& into, work what) {
    if (!into->alive) dead_.push_back(std::move(what)); // not here: whoever submits may own what this destroys
    else (into->paused ? held_ : ready_).push_back({into, std::move(what)});
}

void scheduler::kill(flow& which) {
    which.alive = false;
    auto bury_of = [&](std::deque<entry>& queue) {
        std::deque<entry> kept;
        for (auto& each : queue) {
            if (each.where.get() == &which) dead_.push_back(std::move(each.what));
            else kept.push_back(std::move(each));
        }
        queue.swap(kept);
    };
    bury_of(ready_);
    bury_of(held_);
    for (auto each = timed_.begin(); each != timed_.end();) {
        if (each->second.where.get() == &which) {
            dead_.push_back(std::move(each->second.what));
            each = timed_.erase(each);
        } else {
            ++each;
        }
    }
    bury();
}

void scheduler::bury() {
    if (std::exchange(burying_, true)) return;
    while (!dead_.empty()) {
        auto dropped = std::move(dead_.front());
        dead_.pop_front();
    }
    burying_ = false;
}

void scheduler::go_on(const std::shared_ptr<flow>& which) {
    which->paused = false;
    std::deque<entry> kept;
    for (auto& each : held_) (each.where == which ? ready_ : kept).push_back(std::move(each));
    held_.swap(kept);
}

scheduler::ticket scheduler::at(time_point when, std::shared_ptr<flow> where, work what) {
    ticket made{std::max(when, now_), ++order_};
    timed_.emplace(time_key{made.at, made.order}, entry{std::move(where), std::move(what)});
    return made;
}

void scheduler::cancel(ticket& which) noexcept {
    auto gone = std::exchange(which, {});
    if (gone.order == 0) return;
    auto found = timed_.find({gone.at, gone.order});
    if (found == timed_.end()) return;
    auto dropped = std::move(found->second); // after the table is whole again
    timed_.erase(found);
}

void scheduler::when_outside(work what) {
    if (depth_ > 0) outside_.push_back(std::move(what));
    else what();
}

void scheduler::begin_run() {
    thread_ = std::this_thread::get_id();
    events_in_run_ = events_at_now_ = ownerless_ = 0;
    for (auto& each : flows_) each->events = 0;
}

bool scheduler::step(time_point limit) {
    bury();
    ++depth_;
    struct leave {
        scheduler& self;
        ~leave() { --self.depth_; }
    } leaving{*this};
    if (run_one_of_context() > 0) {
        count(nullptr);
    } else if (!ready_.empty()) {
        auto next = std::move(ready_.front());
        ready_.pop_front();
        run(std::move(next));
    } else {
        if (timed_.empty() || timed_.begin()->first.first > limit) return false;
        auto first = timed_.begin();
        auto next = std::move(first->second);
        advance_to(first->first.first); // an event before it may have taken time
        timed_.erase(first);
        run(std::move(next));
    }
    while (!outside_.empty()) {
        auto what = std::move(outside_.front());
        outside_.pop_front();
        what();
    }
    return true;
}

// Handlers that the program posted to the io_context itself belong to no flow. An io_context without work stops, so
// that it does not ask the system for more at each event.
std::size_t scheduler::run_one_of_context() {
    context_.restart();
    return context_.poll_one();
}

void scheduler::run(entry next) {
    count(next.where.get());
    if (next.where && !next.where->alive) {
        dead_.push_back(std::move(next.what));
        return;
    }
    if (next.where && next.where->paused) {
        held_.push_back(std::move(next));
        return;
    }
    struct leave {
        scheduler& self;
        flow* before;
        ~leave() { self.current_ = before; }
    } leaving{*this, std::exchange(current_, next.where.get())};
    next.what();
}

void scheduler::count(const flow* where) {
    if (counted_at_ != now_) {
        counted_at_ = now_;
        events_at_now_ = 0;
    }
    if (where) ++const_cast<flow*>(where)->events;
    else ++ownerless_;
    if (++events_at_now_ > limits.events_at_one_time) give_up("the clock does not move: a livelock");
    if (++events_in_run_ > limits.events_in_one_run) give_up("one run took more events than its bound");
}

void scheduler::give_up(const char* why) const {
    std::vector<const flow*> busy;
    for (const auto& each : flows_)
        if (each->events > 0) busy.push_back(each.get());
    std::sort(busy.begin(), busy.end(),
              [](auto* a, auto* b) { return a->events != b->events ? a->events > b->events : a->name < b->name; });
    auto text = fmt::format("{} ({} events at {} s, {} in this run); busy:", why, events_at_now_,
                            std::chrono::duration<double>(now_.time_since_epoch()).count(), events_in_run_);
    for (std::size_t i = 0; i < busy.size() && i < 5; ++i)
        text += fmt::format(" {} ({})", busy[i]->name, busy[i]->events);
    if (ownerless_ > 0) text += fmt::format(" network and script ({})", ownerless_);
    throw stuck(text);
}

} // namespace ise::sim
