#pragma once
#include <components/boat/telemetry.hpp>

#include <QString>

namespace atirma::console {

enum class speed_unit : std::uint8_t { knots, metres, kilometres };
enum class distance_unit : std::uint8_t { nautical, metric };
enum class place_format : std::uint8_t { minutes, decimal };

/// The units in which values are shown; the boat itself uses SI.
struct units {
    speed_unit speed = speed_unit::knots;
    distance_unit distance = distance_unit::nautical;
    place_format place = place_format::minutes;
    bool operator==(const units&) const = default;
};

/// The present ones. Windows only, on their thread.
const units& shown_units();
void use_units(const units& chosen);

double speed_value(double metres_per_second);
/// "kn", "m/s", "km/h".
QString speed_name();
/// A value and its unit: "740" and "m", "1.25" and "nm".
std::pair<QString, QString> distance_parts(double metres);
/// "740 m", "1.25 nm", "2.31 km".
QString distance_text(double metres);
/// "007°"; 359.7 is 000°.
QString bearing_text(double degrees);
/// A place as text: 28° 09.180′ N  15° 26.880′ W, or 28.15300, −15.44800.
QString place_text(const waypoint& at);

} // namespace atirma::console
