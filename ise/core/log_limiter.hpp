#pragma once
#include <ise/core/time.hpp>

#include <algorithm>
#include <cstdint>
#include <optional>
#include <utility>

namespace ise {

/// Keeps what a peer can cause as often as it likes from filling the log: a few lines of a kind come through at once,
/// then one in each interval, which tells how many were left out before it.
class log_limiter {
public:
    explicit log_limiter(duration interval = std::chrono::seconds(5), unsigned at_once = 5)
        : interval_(interval), at_once_(at_once), tokens_(at_once) {}

    /// The number of lines left out since the last, if one may be written now.
    std::optional<std::uint64_t> admit(time_point now) {
        if (now - refilled_ >= interval_) {
            auto earned = refilled_ == time_point{} ? at_once_ : (now - refilled_) / interval_;
            tokens_ = static_cast<unsigned>(std::min<std::int64_t>(at_once_, tokens_ + earned));
            refilled_ = now;
        }
        if (tokens_ == 0) {
            ++left_out_;
            return std::nullopt;
        }
        --tokens_;
        return std::exchange(left_out_, 0);
    }

private:
    duration interval_;
    unsigned at_once_;
    unsigned tokens_;
    time_point refilled_{};
    std::uint64_t left_out_ = 0;
};

} // namespace ise
