#pragma once
#include <ise/core/time.hpp>

#include <algorithm>
#include <cstdint>

namespace ise::net {

/// What is known of a peer's monotonic clock: bounds of how far it is ahead of ours, which each round trip of a
/// heartbeat narrows and which widen with time, as clocks drift. Pure.
class peer_clock {
public:
    /// Two clocks part by no more than one part in so many (500 ppm).
    static constexpr int steadiness = 2000;

    /// It is the clock of this process.
    void is_ours() noexcept { known_ = same_ = true; }
    bool known() const noexcept { return known_; }

    /// The peer's clock read `theirs` at some moment between `sent` and `came` of ours. A reading that contradicts
    /// those before (one machine was suspended) counts alone.
    void note(time_point sent, time_point theirs, time_point came) noexcept {
        if (same_ || came < sent || !plausible(theirs)) return;
        const auto low = theirs - came, high = theirs - sent;
        const auto drift = (came - taken_) / steadiness;
        const bool fits = known_ && low <= high_ + drift && high >= low_ - drift;
        low_ = fits ? std::max(low, low_ - drift) : low;
        high_ = fits ? std::min(high, high_ + drift) : high;
        taken_ = came;
        known_ = true;
    }

    /// How far a time of ours may be off at the peer, to either side.
    duration uncertainty(time_point now) const noexcept {
        return same_ ? duration{} : (high_ - low_) / 2 + (now - taken_) / steadiness;
    }

    /// A deadline of ours on the peer's clock: not later, and by up to twice the uncertainty earlier. That is a round
    /// trip: of a deadline that is closer no answer would come in time.
    time_point deadline(time_point ours, time_point now) const noexcept {
        if (same_) return ours;
        return saturating_add(now + (low_ + high_) / 2, ours - now - uncertainty(now));
    }

private:
    // A peer may say anything: within these bounds nothing overflows.
    static constexpr bool plausible(time_point theirs) noexcept {
        constexpr auto most = duration(std::int64_t{1} << 61); // 73 years
        return theirs.time_since_epoch() < most && theirs.time_since_epoch() > -most;
    }

    duration low_{}, high_{};
    time_point taken_{};
    bool known_ = false;
    bool same_ = false;
};

} // namespace ise::net
