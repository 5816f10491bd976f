#include <components/nmea_bridge/signalk.hpp>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <cmath>
#include <numbers>

namespace atirma::signalk {
namespace {

using nlohmann::json;

double radians(double degrees) { return std::round(degrees * std::numbers::pi / 180 * 1e5) / 1e5; }
double direction(double degrees) {
    double turned = std::fmod(degrees, 360);
    return radians(turned < 0 ? turned + 360 : turned);
}
/// -π < x <= π.
double angle(double degrees) {
    double turned = std::remainder(degrees, 360);
    return radians(turned <= -180 ? 180 : turned);
}
double rounded(double value, double step) { return std::round(value / step) * step; }

std::string timestamp(utc_time at) {
    auto day = std::chrono::floor<std::chrono::days>(at);
    std::chrono::year_month_day date(day);
    auto ms = (at - day).count();
    return fmt::format("{:04}-{:02}-{:02}T{:02}:{:02}:{:02}.{:03}Z", static_cast<int>(date.year()),
                       static_cast<unsigned>(date.month()), static_cast<unsigned>(date.day()), ms / 3'600'000,
                       ms / 60'000 % 60, ms / 1000 % 60, ms % 1000);
}

class delta {
public:
    delta(utc_time at, std::string_view source) : at_(timestamp(at)), source_(fmt::format("atirma.{}", source)) {}
    delta& set(const std::string& path, json value) {
        values_.push_back({{"path", path}, {"value", std::move(value)}});
        return *this;
    }
    std::string line() const {
        json update = {{"$source", source_}, {"timestamp", at_}, {"values", values_}};
        json made = {{"context", "vessels.self"}, {"updates", json::array({update})}};
        return made.dump() + "\n";
    }

private:
    std::string at_, source_;
    json values_ = json::array();
};

} // namespace

std::string position(const dated<location>& at) {
    const auto& l = at.value;
    return delta(at.measured_at, name_of(at.link))
        .set("navigation.position",
             {{"latitude", rounded(l.latitude_deg, 1e-7)}, {"longitude", rounded(l.longitude_deg, 1e-7)}})
        .set("navigation.speedOverGround", rounded(l.speed_over_ground_mps, 0.01))
        .set("navigation.courseOverGroundTrue", direction(l.course_over_ground_deg))
        .set("navigation.gnss.satellites", l.satellites)
        .line();
}

std::string no_position(utc_time now) { return delta(now, "bridge").set("navigation.position", nullptr).line(); }

std::string attitude(const dated<navigation>& how) {
    const auto& n = how.value;
    return delta(how.measured_at, name_of(how.link))
        .set("navigation.headingTrue", direction(n.heading_deg))
        .set("navigation.attitude",
             {{"roll", angle(n.heel_deg)}, {"pitch", angle(n.pitch_deg)}, {"yaw", angle(n.heading_deg)}})
        .set("steering.rudderAngle", angle(n.rudder_measured_deg))
        .line();
}

std::string wind_of(const dated<wind>& what, const std::optional<dated<navigation>>& heading) {
    const auto& w = what.value;
    delta made(what.measured_at, name_of(what.link));
    made.set("environment.wind.angleApparent", angle(w.apparent_angle_deg))
        .set("environment.wind.speedApparent", rounded(w.apparent_speed_mps, 0.01))
        .set("environment.wind.directionTrue", direction(w.true_direction_deg))
        .set("environment.wind.speedTrue", rounded(w.true_speed_mps, 0.01));
    if (heading) made.set("environment.wind.angleTrueWater", angle(w.true_direction_deg - heading->value.heading_deg));
    return made.line();
}

std::string battery(const dated<power>& what) {
    const auto& p = what.value;
    return delta(what.measured_at, name_of(what.link))
        .set("electrical.batteries.main.voltage", rounded(p.battery_v, 0.001))
        .set("electrical.batteries.main.current", rounded(p.battery_a, 0.001))
        .set("electrical.batteries.main.capacity.stateOfCharge", p.battery_percent / 100.0)
        .line();
}

std::string link_of(const dated<link_status>& how) {
    const auto& s = how.value;
    auto below = fmt::format("communication.links.{}.", name_of(s.link));
    delta made(how.measured_at, name_of(how.link));
    made.set(below + "up", s.up)
        .set(below + "queued", s.queued)
        .set(below + "sent", s.sent)
        .set(below + "failed", s.failed)
        .set(below + "dropped", s.dropped);
    made.set(below + "lastHeardAge", rounded(s.last_heard_age_s, 0.1));
    if (s.rssi_dbm != 0) made.set(below + "rssi", s.rssi_dbm);
    return made.line();
}

} // namespace atirma::signalk
