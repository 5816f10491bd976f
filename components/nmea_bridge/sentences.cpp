#include <components/nmea_bridge/sentences.hpp>

#include <fmt/format.h>

#include <cmath>

namespace atirma::nmea {
namespace {

constexpr double knots_per_mps = 3600.0 / 1852.0;
constexpr double kmh_per_mps = 3.6;

/// 0 <= x < 360, also after it is rounded to tenths.
double direction(double degrees) {
    double tenths = std::fmod(std::round(degrees * 10), 3600);
    return (tenths < 0 ? tenths + 3600 : tenths) / 10;
}

std::string time_of_day(utc_time at) {
    auto since = std::chrono::floor<std::chrono::milliseconds>(at) - std::chrono::floor<std::chrono::days>(at);
    auto ms = since.count();
    return fmt::format("{:02}{:02}{:02}.{:02}", ms / 3'600'000, ms / 60'000 % 60, ms / 1000 % 60, ms % 1000 / 10);
}

std::string date(utc_time at) {
    std::chrono::year_month_day day(std::chrono::floor<std::chrono::days>(at));
    return fmt::format("{:02}{:02}{:02}", static_cast<unsigned>(day.day()), static_cast<unsigned>(day.month()),
                       static_cast<int>(day.year()) % 100);
}

/// "2809.1800,N": rounded as a whole, so that no minute is 60.
std::string angle(double degrees, int digits, char positive, char negative) {
    auto parts = std::llround(std::abs(degrees) * 60 * 10'000);
    return fmt::format("{:0{}}{:02}.{:04},{}", parts / 600'000, digits, parts / 10'000 % 60, parts % 10'000,
                       degrees < 0 ? negative : positive);
}

std::string place(const location& at) {
    return angle(at.latitude_deg, 2, 'N', 'S') + "," + angle(at.longitude_deg, 3, 'E', 'W');
}

} // namespace

unsigned checksum(std::string_view content) noexcept {
    unsigned sum = 0;
    for (char c : content) sum ^= static_cast<unsigned char>(c);
    return sum;
}

std::string sentence(std::string_view content) { return fmt::format("${}*{:02X}\r\n", content, checksum(content)); }

std::string position(const heard<location>& at) {
    const auto& l = at.value;
    double knots = l.speed_over_ground_mps * knots_per_mps, course = direction(l.course_over_ground_deg);
    char mode = l.quality == fix_quality::simulated ? 'S' : l.quality == fix_quality::differential ? 'D' : 'A';
    auto made = sentence(fmt::format("GPRMC,{},A,{},{:.2f},{:.1f},{},,,{}", time_of_day(at.measured_at), place(l),
                                     knots, course, date(at.measured_at), mode));
    made += sentence(fmt::format("GPGGA,{},{},{},{:02},,,M,,M,,", time_of_day(at.measured_at), place(l),
                                 static_cast<unsigned>(l.quality), l.satellites));
    return made + sentence(fmt::format("GPVTG,{:.1f},T,,M,{:.2f},N,{:.2f},K,{}", course, knots,
                                       l.speed_over_ground_mps * kmh_per_mps, mode));
}

std::string no_position(utc_time now) {
    return sentence(fmt::format("GPRMC,{},V,,,,,,,{},,,N", time_of_day(now), date(now))) +
           sentence(fmt::format("GPGGA,{},,,,,0,00,,,M,,M,,", time_of_day(now)));
}

std::string attitude(const heard<navigation>& how) {
    const auto& n = how.value;
    return sentence(fmt::format("IIHDT,{:.1f},T", direction(n.heading_deg))) +
           sentence(fmt::format("IIRSA,{:.1f},A,,V", n.rudder_measured_deg)) +
           sentence(fmt::format("IIXDR,A,{:.1f},D,ROLL,A,{:.1f},D,PTCH", n.heel_deg, n.pitch_deg));
}

std::string wind_of(const heard<wind>& what, const std::optional<heard<navigation>>& heading) {
    const auto& w = what.value;
    auto made = sentence(fmt::format("IIMWV,{:.1f},R,{:.2f},N,A", direction(w.apparent_angle_deg),
                                     w.apparent_speed_mps * knots_per_mps));
    if (heading)
        made += sentence(fmt::format("IIMWV,{:.1f},T,{:.2f},N,A",
                                     direction(w.true_direction_deg - heading->value.heading_deg),
                                     w.true_speed_mps * knots_per_mps));
    return made;
}

std::string battery(const heard<power>& what) {
    return sentence(
        fmt::format("IIXDR,U,{:.2f},V,BATTERY,I,{:.2f},A,BATTERY", what.value.battery_v, what.value.battery_a));
}

} // namespace atirma::nmea
