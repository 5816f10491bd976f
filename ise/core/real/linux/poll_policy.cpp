#include <ise/core/real/linux/poll_policy.hpp>

#include <algorithm>
#include <utility>

namespace ise::real {

bool poll_policy::on_event() noexcept {
    if (!looking_) {
        if (resting_ > 0) {
            --resting_;
            return false;
        }
        looking_ = true;
    } else if (preempted_) {
        lose();
    } else if (looks_ >= 2) { // what was due anyhow comes before the second look: it proves nothing
        lost_ = 0;
        rest_ = first_rest;
    }
    looks_ = 0;
    preempted_ = false;
    return looking_;
}

bool poll_policy::on_nothing(time_point now) noexcept {
    if (looks_++ == 0) began_ = now;
    last_look_ = now;
    if (!preempted_ && now - began_ < window_) return true;
    lose();
    looking_ = false;
    looks_ = 0;
    preempted_ = false;
    return false;
}

void poll_policy::on_refused() noexcept {
    lost_ = patience;
    lose();
}

void poll_policy::lose() noexcept {
    if (++lost_ < patience) return;
    looking_ = false;
    resting_ = std::exchange(rest_, std::min(rest_ * 2, max_rest));
    lost_ = patience - 1; // one try, then it rests again
}

} // namespace ise::real
