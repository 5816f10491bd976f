#pragma once
#include <chrono>
#include <cstdint>

namespace ise {

/// The monotonic clock of an environment. It has no `now()`: time is read from the environment only,
/// so that the same code runs on the real and on the virtual clock.
struct steady {
    using rep = std::int64_t;
    using period = std::nano;
    using duration = std::chrono::duration<rep, period>;
    using time_point = std::chrono::time_point<steady>;
    static constexpr bool is_steady = true;
};

using duration = steady::duration;
using time_point = steady::time_point;

/// Civil time, UTC, as packets carry it.
using wall_time = std::chrono::sys_time<std::chrono::nanoseconds>;

/// `at` + `after` that stops at the end of time instead of wrapping.
constexpr time_point saturating_add(time_point at, duration after) noexcept {
    if (after > time_point::max() - at) return time_point::max();
    return at + after;
}

} // namespace ise
