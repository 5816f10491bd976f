#pragma once
#include <chrono>
#include <cstdint>

namespace ise {

/// The monotonic clock of an environment. It has no `now()`: time is read from the environment only,
/// so that the same code runs on the real and on the virtual clock.
struct steady {
    /// What a `std::chrono` clock has: it counts nanoseconds.
    using rep = std::int64_t;
    /// As above.
    using period = std::nano;
    /// As above.
    using duration = std::chrono::duration<rep, period>;
    /// As above.
    using time_point = std::chrono::time_point<steady>;
    /// Never set back.
    static constexpr bool is_steady = true;
};

/// Lengths of time throughout ISE, in nanoseconds; every `std::chrono` duration of whole units converts.
using duration = steady::duration;
/// Times of the monotonic clock, valid within one environment only.
using time_point = steady::time_point;

/// Civil time, UTC, as packets carry it.
using wall_time = std::chrono::sys_time<std::chrono::nanoseconds>;

/// `at` + `after`, saturating instead of overflowing.
constexpr time_point saturating_add(time_point at, duration after) noexcept {
    if (after > time_point::max() - at) return time_point::max();
    return at + after;
}

} // namespace ise
