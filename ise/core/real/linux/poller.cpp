#include <ise/core/real/linux/poller.hpp>

#include <ise/core/environment.hpp>

#include <asio/any_io_executor.hpp>
#include <asio/post.hpp>

#include <sched.h>
#include <sys/resource.h>

#include <algorithm>
#include <utility>

namespace ise::real {
namespace {

// That the calling thread may run on now: an administrator may change them.
int usable_cores() noexcept {
    cpu_set_t set;
    if (::sched_getaffinity(0, sizeof set, &set) != 0) return 1;
    return CPU_COUNT(&set);
}

} // namespace

bool poll_seats::take() noexcept {
    if (taken_.fetch_add(1, std::memory_order_relaxed) < usable_cores()) return true;
    give_back();
    return false;
}

poller::poller(environment& world, asio::any_io_executor on, duration window, std::shared_ptr<poll_seats> seats)
    : world_(world), on_(std::move(on)), policy_(window), seats_(std::move(seats)) {}

poller::~poller() { leave(); }

void poller::on_turn(time_point now) {
    if (stopped_) return;
    if (policy_.suspicious(now) && preempted()) policy_.on_preempted();
    if (!policy_.on_event()) return leave();
    if (!seated_) {
        seated_ = seats_->take();
        if (!seated_) return policy_.on_refused();
        preempted(); // what was before does not count
    }
    if (!queued_) post_look();
}

void poller::stop() noexcept {
    stopped_ = true;
    leave();
}

void poller::post_look() {
    queued_ = true;
    asio::post(on_, [this] { look(); });
}

// Runs behind everything that came.
void poller::look() {
    queued_ = false;
    if (stopped_ || !policy_.looking()) return;
    if (look_around()) return;
    auto now = world_.now();
    if (policy_.suspicious(now) && preempted()) policy_.on_preempted();
    if (policy_.on_nothing(now)) {
        post_look();
    } else {
        leave();
    }
}

void poller::leave() noexcept {
    if (std::exchange(seated_, false)) seats_->give_back();
    for (auto* one : std::exchange(around_, {}))
        if (one) one->rest();
}

bool poller::look_at(unannounced& what) {
    if (stopped_ || !seated_ || !policy_.looking()) return false;
    if (std::ranges::find(around_, &what) == around_.end()) around_.push_back(&what);
    return true;
}

void poller::forget(unannounced& what) noexcept {
    std::ranges::replace(around_, &what, static_cast<unannounced*>(nullptr));
}

// Whether something came; its turn has told the policy so.
bool poller::look_around() {
    bool came = false;
    for (std::size_t at = 0; at < around_.size(); ++at) {
        auto* one = around_[at];
        if (!one) continue;
        around_[at] = nullptr; // it may ask anew, or be gone
        if (one->look()) came = true;
        else if (at < around_.size()) around_[at] = one;
    }
    std::erase(around_, nullptr);
    return came;
}

bool poller::preempted() noexcept {
    rusage used{};
    if (::getrusage(RUSAGE_THREAD, &used) != 0) return false;
    return std::exchange(preemptions_, used.ru_nivcsw) != used.ru_nivcsw;
}

} // namespace ise::real
