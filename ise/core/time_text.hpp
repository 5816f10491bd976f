#pragma once
#include <ise/core/result.hpp>
#include <ise/core/time.hpp>

#include <string>
#include <string_view>

namespace ise {

namespace detail {
std::string iso_8601(std::chrono::sys_seconds at, std::chrono::nanoseconds fraction, int decimals);
} // namespace detail

/// "2026-11-21T10:00:00.250Z": a time in UTC as ISO 8601 and RFC 3339 write it, with so many decimals of a second, 0 to
/// 9; what is finer is cut off. Years before 0 and after 9999 have a sign or more digits.
template <class Duration>
std::string iso_8601(std::chrono::sys_time<Duration> at, int decimals = 0) {
    auto seconds = std::chrono::floor<std::chrono::seconds>(at);
    return detail::iso_8601(seconds, at - seconds, decimals);
}

/// "5s", "250ms", "1.5m", "2h"; a bare number means seconds. errc::invalid_argument shows right ones.
result<duration> parse_duration(std::string_view text);

} // namespace ise
