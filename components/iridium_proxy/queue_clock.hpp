#pragma once
#include <components/boat/packet_header.hpp>

#include <ise/core/time.hpp>

#include <algorithm>
#include <chrono>

namespace atirma {

/// Civil time that never goes back and that the steady clock never overtakes, also over a restart of the proxy or of
/// its machine: where the clock is set back no telecommand lives longer by that. It stays ahead where the clock was
/// ahead once, so it measures only.
struct queue_clock {
    std::chrono::milliseconds ahead = std::chrono::milliseconds::min(); ///< of the steady clock
    utc_time last{}; ///< read; the steady clock begins anew with the machine, and `ahead` is of no use then

    utc_time read(utc_time wall, ise::time_point now) {
        auto steady = std::chrono::floor<std::chrono::milliseconds>(now.time_since_epoch());
        ahead = std::max({ahead, wall.time_since_epoch() - steady, last.time_since_epoch() - steady});
        return last = utc_time(ahead + steady);
    }
};

} // namespace atirma
