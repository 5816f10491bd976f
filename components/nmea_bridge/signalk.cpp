#include <components/nmea_bridge/signalk.hpp>

#include <ise/core/time_text.hpp>

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

class delta {
public:
    delta(utc_time at, std::string_view source)
        : at_(ise::iso_8601(at, 3)), source_(fmt::format("atirma.{}", source)) {}
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

bool is_uuid(const std::string& text) noexcept {
    if (text.size() != 36) return false;
    for (std::size_t i = 0; i < text.size(); ++i) {
        bool dash = i == 8 || i == 13 || i == 18 || i == 23;
        bool digit = (text[i] >= '0' && text[i] <= '9') || (text[i] >= 'a' && text[i] <= 'f');
        if (dash ? text[i] != '-' : !digit) return false;
    }
    return text[14] == '4' && (text[19] == '8' || text[19] == '9' || text[19] == 'a' || text[19] == 'b');
}

std::string identity(const std::string& name, const std::string& uuid) {
    if (!uuid.empty()) return "urn:mrn:signalk:uuid:" + uuid;
    std::uint64_t half[2] = {0xcbf29ce484222325u, 0x84222325cbf29ce4u}; // FNV-1a from two beginnings
    for (auto& sum : half)
        for (char c : name) sum = (sum ^ static_cast<unsigned char>(c)) * 0x100000001b3u;
    return fmt::format("urn:mrn:signalk:uuid:{:08x}-{:04x}-4{:03x}-{:x}{:03x}-{:012x}", half[0] >> 32,
                       half[0] >> 16 & 0xffff, half[0] & 0xfff, 8 + (half[1] >> 62), half[1] >> 48 & 0xfff,
                       half[1] & 0xffffffffffff);
}

std::string hello(const std::string& identity, utc_time now) {
    json made = {{"name", "atirma nmea_bridge"},
                 {"version", "1.7.0"}, // of the specification
                 {"timestamp", ise::iso_8601(now, 3)},
                 {"self", "vessels." + identity},
                 {"roles", {"master", "main"}}};
    return made.dump() + "\n";
}

std::string about(const std::string& name, utc_time now) {
    json meta = json::array();
    auto add = [&](const std::string& path, const char* units, const char* meaning) {
        json value = {{"description", meaning}};
        if (*units) value["units"] = units;
        meta.push_back({{"path", path}, {"value", value}});
    };
    for (auto link : {link_id::xbee, link_id::gprs, link_id::iridium}) {
        auto below = fmt::format("communication.links.{}.", name_of(link));
        add(below + "up", "", "Whether the boat's end of the link works");
        add(below + "rssi", "dBm", "Strength of the last packet from the shore, at the boat");
        add(below + "queued", "", "Packets that wait at the boat for this link");
        add(below + "sent", "", "Packets that the boat has sent over this link");
        add(below + "failed", "", "Packets that the boat could not send over this link");
        add(below + "dropped", "", "Packets that the boat never sent, as its queue was full");
        add(below + "lastHeardAge", "s", "Since the boat heard the shore over this link");
    }
    json named = {{"$source", "atirma.bridge"},
                  {"timestamp", ise::iso_8601(now, 3)},
                  {"values", json::array({{{"path", ""}, {"value", {{"name", name}}}}})},
                  {"meta", meta}};
    json made = {{"context", "vessels.self"}, {"updates", json::array({named})}};
    return made.dump() + "\n";
}

std::string position(const heard<location>& at) {
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

std::string attitude(const heard<navigation>& how) {
    const auto& n = how.value;
    return delta(how.measured_at, name_of(how.link))
        .set("navigation.headingTrue", direction(n.heading_deg))
        .set("navigation.attitude",
             {{"roll", angle(n.heel_deg)}, {"pitch", angle(n.pitch_deg)}, {"yaw", angle(n.heading_deg)}})
        .set("steering.rudderAngle", angle(n.rudder_measured_deg))
        .line();
}

std::string wind_of(const heard<wind>& what, const std::optional<heard<navigation>>& heading) {
    const auto& w = what.value;
    delta made(what.measured_at, name_of(what.link));
    made.set("environment.wind.angleApparent", angle(w.apparent_angle_deg))
        .set("environment.wind.speedApparent", rounded(w.apparent_speed_mps, 0.01))
        .set("environment.wind.directionTrue", direction(w.true_direction_deg))
        .set("environment.wind.speedTrue", rounded(w.true_speed_mps, 0.01));
    if (heading) made.set("environment.wind.angleTrueWater", angle(w.true_direction_deg - heading->value.heading_deg));
    return made.line();
}

std::string battery(const heard<power>& what) {
    const auto& p = what.value;
    return delta(what.measured_at, name_of(what.link))
        .set("electrical.batteries.main.voltage", rounded(p.battery_v, 0.001))
        .set("electrical.batteries.main.current", rounded(p.battery_a, 0.001))
        .set("electrical.batteries.main.capacity.stateOfCharge", p.battery_percent / 100.0)
        .line();
}

std::string link_of(const heard<link_status>& how) {
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
