#include "arrivals.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace ise::cli {

void arrivals::add(time_point at) {
    ++packets_;
    auto before = std::exchange(last_, at);
    if (!before) return;
    auto interval = at - *before;
    ++intervals_;
    // Welford: one pass, no loss of digits.
    double seconds = std::chrono::duration<double>(interval).count();
    double off = seconds - mean_s_;
    mean_s_ += off / static_cast<double>(intervals_);
    squares_ += off * (seconds - mean_s_);
    shortest_ = std::min(shortest_, interval);
    longest_ = std::max(longest_, interval);
}

arrivals::summary arrivals::take(duration window) {
    summary made;
    made.packets = packets_;
    made.intervals = intervals_;
    made.rate_hz = static_cast<double>(packets_) / std::chrono::duration<double>(window).count();
    if (intervals_ != 0) {
        made.mean = std::chrono::duration_cast<duration>(std::chrono::duration<double>(mean_s_));
        made.jitter = std::chrono::duration_cast<duration>(
            std::chrono::duration<double>(std::sqrt(squares_ / static_cast<double>(intervals_))));
        made.shortest = shortest_;
        made.longest = longest_;
    }
    auto last = last_;
    *this = arrivals();
    last_ = last;
    return made;
}

} // namespace ise::cli
