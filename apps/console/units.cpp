#include "units.hpp"

#include <cmath>

namespace atirma::console {
namespace {

units& used_units() {
    static units used;
    return used;
}

QString minutes_text(double degrees, QChar positive, QChar negative) {
    auto all = std::llround(std::abs(degrees) * 60 * 1000); // rounded before it is divided, so that no minute is 60
    return QStringLiteral("%1° %2.%3′ %4")
        .arg(all / 60'000)
        .arg(all / 1000 % 60, 2, 10, QLatin1Char('0'))
        .arg(all % 1000, 3, 10, QLatin1Char('0'))
        .arg(degrees < 0 ? negative : positive);
}

} // namespace

const units& shown_units() { return used_units(); }
void use_units(const units& chosen) { used_units() = chosen; }

double speed_value(double metres_per_second) {
    switch (used_units().speed) {
        case speed_unit::knots: return metres_per_second * 3600 / 1852;
        case speed_unit::metres: return metres_per_second;
        case speed_unit::kilometres: return metres_per_second * 3.6;
    }
    return metres_per_second;
}

QString speed_name() {
    switch (used_units().speed) {
        case speed_unit::knots: return QStringLiteral("kn");
        case speed_unit::metres: return QStringLiteral("m/s");
        case speed_unit::kilometres: return QStringLiteral("km/h");
    }
    return {};
}

std::pair<QString, QString> distance_parts(double metres) {
    bool metric = used_units().distance == distance_unit::metric;
    if (metres < (metric ? 1000 : 1852)) return {QString::number(metres, 'f', metres < 10 ? 1 : 0), "m"};
    return {QString::number(metres / (metric ? 1000 : 1852), 'f', 2), metric ? "km" : "nm"};
}

QString distance_text(double metres) {
    auto [value, unit] = distance_parts(metres);
    return value + " " + unit;
}

QString bearing_text(double degrees) {
    return QStringLiteral("%1°").arg(std::fmod(std::round(degrees) + 360, 360), 3, 'f', 0, QLatin1Char('0'));
}

QString place_text(const waypoint& at) {
    if (used_units().place == place_format::decimal)
        return QStringLiteral("%1, %2")
            .arg(at.latitude_deg, 0, 'f', 5)
            .arg(at.longitude_deg, 0, 'f', 5)
            .replace('-', QChar(0x2212));
    return minutes_text(at.latitude_deg, 'N', 'S') + "  " + minutes_text(at.longitude_deg, 'E', 'W');
}

} // namespace atirma::console
