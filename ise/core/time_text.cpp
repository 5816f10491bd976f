#include "time_text.hpp"

#include <ise/core/readable.hpp>

#include <fmt/format.h>

#include <charconv>

namespace ise {
namespace detail {

std::string iso_8601(std::chrono::sys_seconds at, std::chrono::nanoseconds fraction, int decimals) {
    auto day = std::chrono::floor<std::chrono::days>(at);
    std::chrono::year_month_day date(day);
    std::chrono::hh_mm_ss time(at - day);
    auto text = fmt::format("{:04}-{:02}-{:02}T{:02}:{:02}:{:02}", static_cast<int>(date.year()),
                            static_cast<unsigned>(date.month()), static_cast<unsigned>(date.day()),
                            time.hours().count(), time.minutes().count(), time.seconds().count());
    if (decimals > 0) {
        auto digits = fmt::format(".{:09}", fraction.count());
        text += digits.substr(0, static_cast<std::size_t>(decimals) + 1);
    }
    return text + 'Z';
}

} // namespace detail

result<duration> parse_duration(std::string_view text) {
    double number = 0;
    auto [end, problem] = std::from_chars(text.data(), text.data() + text.size(), number);
    auto unit = text.substr(static_cast<std::size_t>(end - text.data()));
    double seconds = unit.empty() || unit == "s"    ? 1
                     : unit == "ms"                 ? 1e-3
                     : unit == "us"                 ? 1e-6
                     : unit == "m" || unit == "min" ? 60
                     : unit == "h"                  ? 3600
                                                    : 0;
    constexpr double max_seconds = 1e9; // 30 years
    if (problem != std::errc() || seconds == 0 || !(number >= 0) || number * seconds > max_seconds)
        return failure(errc::invalid_argument, fmt::format("'{}' is not a duration: write 5s, 250ms, 1.5m or 2h",
                                                           readable(text.substr(0, 80))));
    return std::chrono::duration_cast<duration>(std::chrono::duration<double>(number * seconds));
}

} // namespace ise
