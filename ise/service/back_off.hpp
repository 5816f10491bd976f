#pragma once
#include <ise/core/environment.hpp>

#include <algorithm>

namespace ise {

/// How long to wait before the next try: doubles up to a limit, with jitter, so that the clients of one restarted
/// provider do not come back all at once.
class back_off {
public:
    back_off(environment& env, duration first, duration longest)
        : env_(env), first_(first), longest_(longest), next_(first) {}

    duration next() {
        auto base = std::exchange(next_, std::min(next_ * 2, longest_));
        // Between half of it and all of it.
        auto spread = static_cast<std::uint64_t>(base.count() / 2) + 1;
        return duration(base.count() / 2 + static_cast<std::int64_t>(env_.random() % spread));
    }
    /// After a session that was lost: any time up to `spread`, or up to the pause that is due if that is longer, for
    /// others have lost theirs at the same moment. Later pauses are no shorter than that, or the crowd would gather
    /// again.
    duration after_loss(duration spread) {
        auto most = std::max(std::exchange(next_, std::min(std::max(next_, spread) * 2, longest_)), spread);
        return duration(static_cast<std::int64_t>(env_.random() % (static_cast<std::uint64_t>(most.count()) + 1)));
    }
    void reset() noexcept { next_ = first_; }
    /// Never longer than this from now on.
    void limit(duration longest) noexcept {
        longest_ = std::min(longest_, longest);
        first_ = std::min(first_, longest_);
        next_ = std::min(next_, longest_);
    }

private:
    environment& env_;
    duration first_;
    duration longest_;
    duration next_;
};

} // namespace ise
