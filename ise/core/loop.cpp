#include <ise/core/loop.hpp>

#include <ise/core/executor.hpp>
#include <ise/core/loop_executor.hpp>

#include <asio/any_io_executor.hpp>
#include <asio/post.hpp>

#include <algorithm>
#include <utility>

namespace ise {
namespace {

// Works a list off; what comes meanwhile goes into `next`, an empty one, and the two change places. Keeps their room,
// unless it was an exceptional one. Where `ended` comes to hold the rest is dropped.
template <class T, class Do>
void work_off(std::vector<T>& list, std::vector<T>& next, const bool& ended, Do work) {
    constexpr std::size_t most = 1024;
    std::swap(list, next);
    for (auto one = next.begin(); one != next.end() && !ended; ++one) work(*one);
    if (next.capacity() <= most) next.clear();
    else next = std::vector<T>();
}

// Without Asio between where the loop is not an io_context.
template <class Work>
void post_to(const asio::any_io_executor& on, Work work) {
    if (auto* own = executor_cast<loop_executor>(on)) own->queue().post(std::move(work));
    else asio::post(on, std::move(work));
}

} // namespace

// The posted work does not take the lock: where both threads share a core, it may run before `post` has returned.
bool loop_gate::post(unique_function<void()> work) {
    std::lock_guard lock(mutex_);
    auto* into = loop_.load();
    if (!into) return false;
    post_to(into->get_executor(), [gate = shared_from_this(), work = std::move(work)]() mutable {
        auto* here = gate->loop_.load();
        if (!here) return;
        loop::turn in(*here); // on the loop's own thread, which alone can end it
        work();
    });
    return true;
}

void loop_gate::shut() noexcept {
    std::lock_guard lock(mutex_);
    loop_ = nullptr;
}

timer::timer(loop& owner, std::function<void()> fire) : loop_(owner), fire_(std::move(fire)) {}
timer::~timer() {
    if (slot_ != unlisted) loop_.remove(*this);
}

// A deadline that is met is the rule: a timer that is disarmed, or moved to a later time, stays listed under its old
// time and is looked at when that comes. A call's timer, disarmed and armed anew for every call, is moved in the
// list once in a deadline's length instead of twice a call.
[[gnu::hot]] void timer::arm(time_point at) {
    if (loop_.abandoned()) return;
    at_ = at;
    order_ = loop_.armed_count_++;
    armed_ = true;
    if (slot_ != unlisted) {
        if (listed_at_ < at) return;
        loop_.remove(*this);
    }
    loop_.insert(*this);
}

loop::loop(environment& environment, const executor_type& executor, std::function<bool()> running_here)
    : environment_(environment), executor_(std::make_unique<executor_type>(executor)),
      running_here_(std::move(running_here)), gate_(std::make_shared<loop_gate>(*this)) {}

loop::~loop() {
    *alive_ = false;
    abandon();
}

void loop::abandon() noexcept {
    abandoned_ = true;
    gate_->shut();
    for (timer* entry : heap_) {
        entry->slot_ = timer::unlisted;
        entry->armed_ = false;
    }
    heap_.clear();
    // What is dropped may drop more, or touch the loop: every step leaves the lists whole.
    while (suspended_) {
        suspended& first = *suspended_;
        delist(first);
        first.drop();
    }
    while (!ready_.empty()) auto dropped = std::exchange(ready_, {});
    while (outputs_.listed()) {
        auto& first = *outputs_.next->of;
        first.entry_.leave();
        auto dropped = std::move(first.held_);
    }
}

[[gnu::hot]] void loop::enlist(suspended& entry) noexcept {
    entry.previous_ = nullptr;
    entry.next_ = suspended_;
    if (suspended_) suspended_->previous_ = &entry;
    suspended_ = &entry;
}

[[gnu::hot]] void loop::delist(suspended& entry) noexcept {
    (entry.previous_ ? entry.previous_->next_ : suspended_) = entry.next_;
    if (entry.next_) entry.next_->previous_ = entry.previous_;
    entry.previous_ = entry.next_ = nullptr;
}

bool loop::before(const timer& a, const timer& b) noexcept {
    return a.listed_at_ != b.listed_at_ ? a.listed_at_ < b.listed_at_ : a.listed_order_ < b.listed_order_;
}

void loop::insert(timer& entry) {
    heap_.push_back(&entry); // may throw
    entry.listed_at_ = entry.at_;
    entry.listed_order_ = entry.order_;
    entry.slot_ = heap_.size() - 1;
    sift_up(entry.slot_);
    wake_for_first();
}

std::size_t loop::armed_timers() const noexcept {
    return static_cast<std::size_t>(
        std::count_if(heap_.begin(), heap_.end(), [](const timer* entry) { return entry->armed(); }));
}

void loop::remove(timer& entry) noexcept {
    std::size_t hole = std::exchange(entry.slot_, timer::unlisted);
    timer* last = heap_.back();
    heap_.pop_back();
    if (hole == heap_.size()) return;
    heap_[hole] = last;
    last->slot_ = hole;
    sift_up(hole);
    sift_down(last->slot_);
}

void loop::sift_up(std::size_t slot) noexcept {
    timer* entry = heap_[slot];
    while (slot > 0) {
        std::size_t parent = (slot - 1) / 2;
        if (!before(*entry, *heap_[parent])) break;
        heap_[slot] = heap_[parent];
        heap_[slot]->slot_ = slot;
        slot = parent;
    }
    heap_[slot] = entry;
    entry->slot_ = slot;
}

void loop::sift_down(std::size_t slot) noexcept {
    timer* entry = heap_[slot];
    for (;;) {
        std::size_t child = slot * 2 + 1;
        if (child >= heap_.size()) break;
        if (child + 1 < heap_.size() && before(*heap_[child + 1], *heap_[child])) ++child;
        if (!before(*heap_[child], *entry)) break;
        heap_[slot] = heap_[child];
        heap_[slot]->slot_ = slot;
        slot = child;
    }
    heap_[slot] = entry;
    entry->slot_ = slot;
}

// The alarm is moved only when something earlier comes: a deadline that is met costs no system call, and an
// alarm that finds nothing due arms itself for what is left. It is moved once a turn, behind what is written: others
// wait for that.
void loop::wake_for_first() {
    if (depth_ > 0 || heap_.empty() || heap_.front()->listed_at_ >= alarm_at_) return;
    alarm_at_ = heap_.front()->listed_at_;
    if (alarm_) alarm_->arm(alarm_at_);
}

void loop::on_alarm() {
    if (abandoned_) return;
    alarm_at_ = time_point::max();
    turn in(*this);
    turn_time_ = environment_.now();
    // What is armed by what fires here waits for the next turn, or a timer that moves itself to a time that
    // has passed would never let go.
    const auto newcomers = armed_count_;
    while (!heap_.empty() && heap_.front()->listed_at_ <= turn_time_) {
        timer* due = heap_.front();
        bool moved = due->listed_at_ != due->at_;
        if (due->armed_ && !moved && due->order_ >= newcomers) break;
        remove(*due);
        if (!due->armed_) continue;
        if (moved) {
            insert(*due);
            continue;
        }
        due->armed_ = false;
        due->fire_(); // may destroy *due
        if (abandoned_) return;
    }
}

[[gnu::hot]] void loop::flush_later(flushable& output) {
    if (output.flush_due() || abandoned_) return;
    if (depth_ == 0 && !turn_posted_) {
        post_turn();
        output.flush();
        return;
    }
    outputs_.push_back(output.entry_);
}

[[gnu::hot]] void loop::flush_later(std::shared_ptr<flushable> output) {
    auto& listed = *output;
    if (listed.flush_due()) return;
    flush_later(listed);
    if (listed.flush_due()) listed.held_ = std::move(output);
}

void loop::flush_soon(flushable& output) {
    if (output.flush_due() || abandoned_) return;
    outputs_.push_back(output.entry_);
    if (depth_ == 0) post_turn();
}

void loop::post_turn() {
    if (turn_posted_) return;
    post_to(*executor_, [this, alive = alive_] { // may throw
        if (!*alive) return;
        turn in(*this);
    });
    turn_posted_ = true;
}

[[gnu::hot]] loop::turn::turn(loop& owner) : loop_(owner) {
    if (loop_.depth_++ == 0) {
        loop_.turn_time_ = loop_.environment_.now();
        loop_.turn_posted_ = false;
        if (loop_.watcher_) loop_.watcher_->on_turn(loop_.turn_time_);
    }
}

[[gnu::hot]] loop::turn::~turn() {
    if (loop_.depth_ == 1) loop_.end_turn();
    if (--loop_.depth_ == 0) loop_.wake_for_first();
}

// Coroutines first, then one output after the other. What is resumed or flushed may make more ready, and list more; all
// of it belongs to this turn, bounded so that the sockets get their share.
[[gnu::hot]] void loop::end_turn() {
    for (int left = 256; left > 0; --left) {
        if (!ready_.empty()) work_off(ready_, spare_ready_, abandoned_, [](auto& resume) { resume(); });
        else if (outputs_.listed()) flush_first();
        else return;
        if (abandoned_) return;
    }
    if (!ready_.empty() || outputs_.listed()) post_turn();
}

[[gnu::hot]] void loop::flush_first() {
    auto& output = *outputs_.next->of;
    output.entry_.leave();
    if (!output.held_) return output.flush();
    auto held = std::move(output.held_);
    held->flush();
}

} // namespace ise
