#include <components/boat/report_rhythm.hpp>

#include <algorithm>
#include <chrono>
#include <cmath>

namespace atirma {
namespace {
// Over Iridium the longest period that people use: nothing is called lost before the second report shows the pace.
constexpr std::array<double, link_count> usual_s{2, 10, 1800};
} // namespace

freshness_limits limits_of(double period_s) noexcept {
    return {std::max(6.0, 2 * period_s), std::max(30.0, 3 * period_s)};
}

double period_of(value_kind kind, double position_s) noexcept {
    switch (kind) { // the boat reports it every so many periods
        case value_kind::position:
        case value_kind::sailing: return position_s;
        case value_kind::breeze: return 2 * position_s;
        case value_kind::supply: return 10 * position_s;
        case value_kind::links: return 15 * position_s;
        case value_kind::settings:
        case value_kind::waypoints: return 30 * position_s;
    }
    return position_s;
}

void report_rhythm::on_report(link_id link, utc_time measured_at) noexcept {
    auto place = static_cast<std::size_t>(link);
    if (place >= link_count) return;
    auto& pace = links_[place];
    if (pace.last && measured_at <= *pace.last) return;
    if (pace.last) pace.seen_s[pace.seen++ % kept] = std::chrono::duration<double>(measured_at - *pace.last).count();
    pace.last = measured_at;
}

void report_rhythm::on_configuration(const configuration& result) noexcept {
    for (std::size_t i = 0; i < link_count; ++i) {
        double period = static_cast<double>(result.telemetry_period_s[i]);
        auto& pace = links_[i];
        if (!std::isfinite(period) || period < 0 || period == pace.told_s) continue;
        pace.told_s = period;
        pace.seen = 0; // what was seen was the former period
    }
}

double report_rhythm::position_s(link_id link) const noexcept {
    auto place = static_cast<std::size_t>(link);
    if (place >= link_count) return 60;
    const auto& pace = links_[place];
    auto count = std::min(pace.seen, kept);
    double seen = 0;
    if (count > 0) {
        auto sorted = pace.seen_s;
        auto end = sorted.begin() + static_cast<std::ptrdiff_t>(count);
        std::sort(sorted.begin(), end);
        seen = sorted[count / 2];
    }
    if (pace.told_s > 0) // a gap is no pace: two intervals must agree before a slower one is believed
        return count >= 3 ? std::max(pace.told_s, seen) : pace.told_s;
    return count > 0 ? seen : usual_s[place];
}

double report_rhythm::outage_s(link_id before, link_id after) const noexcept {
    return std::max({180.0, limits(value_kind::position, before).stale_s, limits(value_kind::position, after).stale_s});
}

} // namespace atirma
