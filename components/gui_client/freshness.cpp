#include <components/gui_client/freshness.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace atirma::console {

double age_s(utc_time now, utc_time measured_at) noexcept {
    return std::max(0.0, static_cast<double>((now - measured_at).count()) / 1000);
}

freshness judge(double age, double expected_s) noexcept {
    auto limits = limits_of(expected_s);
    if (age <= limits.fresh_s) return freshness::fresh;
    return age < limits.stale_s ? freshness::ageing : freshness::stale;
}

std::string age_text(double seconds) {
    auto s = static_cast<long long>(seconds);
    if (s < 1) return "now";
    if (s < 120) return fmt::format("{} s", s);
    if (s < 7200) return fmt::format("{} min", s / 60);
    if (s < 48 * 3600) return fmt::format("{} h {:02}", s / 3600, s / 60 % 60);
    return fmt::format("{} d", s / 86400);
}

std::optional<double> time_to_waypoint_s(const boat_view& boat) noexcept {
    if (!boat.position || !boat.sailing || boat.sailing->value.waypoint_count == 0) return std::nullopt;
    const auto& at = boat.position->value;
    const auto& to = boat.sailing->value;
    double off = static_cast<double>(at.course_over_ground_deg - to.bearing_to_waypoint_deg) * std::numbers::pi / 180;
    double made_good = static_cast<double>(at.speed_over_ground_mps) * std::cos(off);
    if (made_good < 0.05) return std::nullopt;
    return static_cast<double>(to.distance_to_waypoint_m) / made_good;
}

} // namespace atirma::console
