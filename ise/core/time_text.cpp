#include "time_text.hpp"

#include <fmt/format.h>

namespace ise::detail {

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

} // namespace ise::detail
