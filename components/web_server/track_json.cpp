#include <components/web_server/track_json.hpp>

#include <fmt/format.h>

#include <cmath>
#include <cstdint>
#include <optional>

namespace atirma {

namespace {
json maybe(const std::optional<double>& value, int decimals) {
    return value ? json(rounded(*value, decimals)) : json();
}

json begin(const report_origin& from) {
    return {{"measured_at", to_json(from.measured_at)},
            {"received_at", to_json(from.received_at)},
            {"source", from.source},
            {"history", from.history}};
}
} // namespace

double rounded(double value, int decimals) {
    double scale = std::pow(10.0, decimals);
    return std::round(value * scale) / scale;
}

std::string printable(std::string_view text) {
    std::string safe;
    for (char c : text) safe += c >= 0x20 && c < 0x7f ? c : '?';
    return safe;
}

std::string to_text(const json& value) { return value.dump(-1, ' ', false, json::error_handler_t::replace); }

json to_json(utc_ms at) { return at.time_since_epoch().count(); }

json to_json(const position_update& update) {
    auto out = begin(update.from);
    out["latitude_deg"] = rounded(update.latitude_deg, 7);
    out["longitude_deg"] = rounded(update.longitude_deg, 7);
    out["speed_over_ground_mps"] = maybe(update.speed_over_ground_mps, 3);
    out["course_over_ground_deg"] = maybe(update.course_over_ground_deg, 1);
    out["circular_error_m"] = maybe(update.circular_error_m, 1);
    out["satellites"] = update.satellites ? json(*update.satellites) : json();
    return out;
}

json to_json(const navigation_update& update) {
    auto out = begin(update.from);
    out["heading_deg"] = maybe(update.heading_deg, 1);
    out["heel_deg"] = maybe(update.heel_deg, 1);
    out["pitch_deg"] = maybe(update.pitch_deg, 1);
    out["rudder_deg"] = maybe(update.rudder_deg, 1);
    out["course_to_steer_deg"] = maybe(update.course_to_steer_deg, 1);
    out["cross_track_error_m"] = maybe(update.cross_track_error_m, 1);
    return out;
}

json to_json(const wind_update& update) {
    auto out = begin(update.from);
    out["apparent_angle_deg"] = maybe(update.apparent_angle_deg, 1);
    out["apparent_speed_mps"] = maybe(update.apparent_speed_mps, 2);
    out["true_direction_deg"] = maybe(update.true_direction_deg, 1);
    out["true_speed_mps"] = maybe(update.true_speed_mps, 2);
    return out;
}

json to_json(const power_update& update) {
    auto out = begin(update.from);
    out["battery_voltage_v"] = maybe(update.battery_voltage_v, 2);
    out["battery_current_a"] = maybe(update.battery_current_a, 2);
    out["battery_charge_percent"] = maybe(update.battery_charge_percent, 1);
    return out;
}

json to_json(const waypoints_update& update) {
    auto out = begin(update.from);
    json points = json::array();
    for (const auto& point : update.points)
        points.push_back({{"latitude_deg", rounded(point.latitude_deg, 7)},
                          {"longitude_deg", rounded(point.longitude_deg, 7)},
                          {"name", point.name}});
    out["points"] = std::move(points);
    out["active"] = update.active ? json(*update.active) : json();
    out["closed"] = update.closed;
    return out;
}

json to_json(const mode_update& update) {
    auto out = begin(update.from);
    out["mode"] = update.mode;
    return out;
}

json to_json(const feed_update& update) {
    return {{"source", update.source},
            {"connected", update.connected},
            {"since", to_json(update.since)},
            {"detail", update.detail},
            {"link", update.link}};
}

json track_columns() {
    return {"at",       "latitude_deg",   "longitude_deg",      "speed_mps",        "course_deg", "heading_deg",
            "heel_deg", "wind_speed_mps", "wind_direction_deg", "circular_error_m", "source",     "silence_s"};
}

json to_json(const track_point& point) {
    return {to_json(point.at),
            rounded(point.latitude_deg, 6),
            rounded(point.longitude_deg, 6),
            maybe(point.speed_mps, 2),
            maybe(point.course_deg, 0),
            maybe(point.heading_deg, 0),
            maybe(point.heel_deg, 0),
            maybe(point.wind_speed_mps, 1),
            maybe(point.wind_direction_deg, 0),
            maybe(point.circular_error_m, 0),
            point.source,
            (point.silence.count() + 500) / 1000};
}

namespace {
/// One column; `value_of(i)` is an optional number.
template <class ValueOf>
void append_column(std::string& to, std::string_view name, std::size_t count, std::int64_t scale, ValueOf value_of) {
    to.append("\"").append(name).append("\":[").append(fmt::format_int(scale).c_str()).append(",[");
    std::int64_t before = 0;
    for (std::size_t i = 0; i < count; ++i) {
        if (i > 0) to += ',';
        std::optional<double> value = value_of(i);
        if (!value) {
            to += "null";
            continue;
        }
        auto whole = static_cast<std::int64_t>(std::llround(*value * static_cast<double>(scale)));
        to += fmt::format_int(whole - before).c_str();
        before = whole;
    }
    to += "]]";
}

double ms_of(utc_ms at) { return static_cast<double>(at.time_since_epoch().count()); }
} // namespace

void append_columns(std::string& to, const std::vector<track_point>& points) {
    auto add = [&](std::string_view name, std::int64_t scale, auto value_of) {
        to += to.back() == '{' ? "" : ",";
        append_column(to, name, points.size(), scale,
                      [&](std::size_t i) -> std::optional<double> { return value_of(points[i]); });
    };
    to += '{';
    add("at", 1, [](const track_point& p) { return ms_of(p.at); });
    add("latitude_deg", 1'000'000, [](const track_point& p) { return p.latitude_deg; });
    add("longitude_deg", 1'000'000, [](const track_point& p) { return p.longitude_deg; });
    add("speed_mps", 100, [](const track_point& p) { return p.speed_mps; });
    add("course_deg", 1, [](const track_point& p) { return p.course_deg; });
    add("heading_deg", 1, [](const track_point& p) { return p.heading_deg; });
    add("heel_deg", 1, [](const track_point& p) { return p.heel_deg; });
    add("wind_speed_mps", 10, [](const track_point& p) { return p.wind_speed_mps; });
    add("wind_direction_deg", 1, [](const track_point& p) { return p.wind_direction_deg; });
    add("circular_error_m", 1, [](const track_point& p) { return p.circular_error_m; });
    add("source", 1, [](const track_point& p) { return static_cast<double>(p.source); });
    add("silence_s", 1, [](const track_point& p) { return static_cast<double>((p.silence.count() + 500) / 1000); });
    to += '}';
}

void append_history(std::string& to, const std::vector<std::pair<utc_ms, double>>& values) {
    to += '{';
    append_column(to, "at", values.size(), 1, [&](std::size_t i) { return std::optional(ms_of(values[i].first)); });
    to += ',';
    append_column(to, "value", values.size(), 100, [&](std::size_t i) { return std::optional(values[i].second); });
    to += '}';
}

} // namespace atirma
