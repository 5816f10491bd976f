#include <components/boat/telemetry.hpp>

#include <components/boat/layout.hpp>

#include <fmt/format.h>

namespace atirma {
namespace {

using layout::reader;
using layout::writer;

void write(writer& out, const location& p) {
    out.point({p.latitude_deg, p.longitude_deg});
    out.enumerator(p.quality);
    out.integer(p.satellites);
    out.scaled<std::uint16_t>(p.speed_over_ground_mps, 0.01);
    out.direction(p.course_over_ground_deg);
    out.scaled<std::uint32_t>(p.distance_sailed_m, 0.1);
}
void read(reader& in, location& p) {
    waypoint at = in.point("position");
    p.latitude_deg = at.latitude_deg;
    p.longitude_deg = at.longitude_deg;
    p.quality = in.enumerator<fix_quality>("fix quality");
    p.satellites = in.integer<std::uint8_t>();
    p.speed_over_ground_mps = static_cast<float>(in.scaled<std::uint16_t>(0.01));
    p.course_over_ground_deg = static_cast<float>(in.direction("course over ground"));
    p.distance_sailed_m = static_cast<float>(in.scaled<std::uint32_t>(0.1));
}

void write(writer& out, const navigation& p) {
    out.enumerator(p.mode);
    out.enumerator(p.on);
    out.integer(static_cast<std::uint8_t>((p.in_irons ? 1 : 0) | (p.remote_control ? 2 : 0) | (p.beacon ? 4 : 0) |
                                          (p.at_fence ? 8 : 0)));
    out.direction(p.heading_deg);
    for (float angle : {p.heel_deg, p.pitch_deg, p.rudder_commanded_deg, p.rudder_measured_deg, p.sail_commanded_deg,
                        p.sail_measured_deg})
        out.scaled<std::int16_t>(angle, 0.1);
    out.integer(p.waypoint_index);
    out.integer(p.waypoint_count);
    out.scaled<std::uint32_t>(p.distance_to_waypoint_m, 0.1);
    out.direction(p.bearing_to_waypoint_deg);
    out.direction(p.course_to_steer_deg);
    out.scaled<std::int32_t>(p.cross_track_error_m, 0.1);
    out.integer(p.laps);
}
void read(reader& in, navigation& p) {
    p.mode = in.enumerator<sailing_mode>("mode");
    p.on = in.enumerator<tack>("tack");
    auto flags = in.integer<std::uint8_t>();
    p.in_irons = flags & 1;
    p.remote_control = flags & 2;
    p.beacon = flags & 4;
    p.at_fence = flags & 8;
    p.heading_deg = static_cast<float>(in.direction("heading"));
    for (float* angle : {&p.heel_deg, &p.pitch_deg, &p.rudder_commanded_deg, &p.rudder_measured_deg,
                         &p.sail_commanded_deg, &p.sail_measured_deg})
        *angle = static_cast<float>(in.scaled<std::int16_t>(0.1));
    p.waypoint_index = in.integer<std::uint8_t>();
    p.waypoint_count = in.integer<std::uint8_t>();
    p.distance_to_waypoint_m = static_cast<float>(in.scaled<std::uint32_t>(0.1));
    p.bearing_to_waypoint_deg = static_cast<float>(in.direction("bearing to waypoint"));
    p.course_to_steer_deg = static_cast<float>(in.direction("course to steer"));
    p.cross_track_error_m = static_cast<float>(in.scaled<std::int32_t>(0.1));
    p.laps = in.integer<std::uint16_t>();
}

void write(writer& out, const wind& p) {
    out.scaled<std::int16_t>(p.apparent_angle_deg, 0.01);
    out.scaled<std::uint16_t>(p.apparent_speed_mps, 0.01);
    out.direction(p.true_direction_deg);
    out.scaled<std::uint16_t>(p.true_speed_mps, 0.01);
}
void read(reader& in, wind& p) {
    p.apparent_angle_deg = static_cast<float>(in.scaled<std::int16_t>(0.01));
    p.apparent_speed_mps = static_cast<float>(in.scaled<std::uint16_t>(0.01));
    p.true_direction_deg = static_cast<float>(in.direction("true wind direction"));
    p.true_speed_mps = static_cast<float>(in.scaled<std::uint16_t>(0.01));
}

void write(writer& out, const power& p) {
    out.scaled<std::uint16_t>(p.battery_v, 0.001);
    out.scaled<std::int16_t>(p.battery_a, 0.001);
    out.integer(p.battery_percent);
    out.scaled<std::int16_t>(p.temperature_c, 0.1);
    out.integer(p.uptime_s);
    out.enumerator(p.last_reset);
    out.integer(p.faults);
}
void read(reader& in, power& p) {
    p.battery_v = static_cast<float>(in.scaled<std::uint16_t>(0.001));
    p.battery_a = static_cast<float>(in.scaled<std::int16_t>(0.001));
    p.battery_percent = in.integer<std::uint8_t>();
    if (p.battery_percent > 100) in.fail(fmt::format("a battery cannot be {} % full", p.battery_percent));
    p.temperature_c = static_cast<float>(in.scaled<std::int16_t>(0.1));
    p.uptime_s = in.integer<std::uint32_t>();
    p.last_reset = in.enumerator<reset_cause>("reset cause");
    p.faults = in.integer<std::uint16_t>();
}

void write(writer& out, const waypoints& p) {
    if (p.entries.size() > waypoints::max_entries)
        throw ise::error(ise::errc::invalid_argument,
                         fmt::format("a waypoints packet holds {} entries, not {}: send the list in parts",
                                     waypoints::max_entries, p.entries.size()));
    out.integer(p.revision);
    out.integer(p.count);
    out.integer(p.active);
    out.integer(p.first);
    out.integer(static_cast<std::uint8_t>(p.entries.size()));
    for (auto& entry : p.entries) out.point(entry);
}
void read(reader& in, waypoints& p) {
    p.revision = in.integer<std::uint16_t>();
    p.count = in.integer<std::uint8_t>();
    p.active = in.integer<std::uint8_t>();
    p.first = in.integer<std::uint8_t>();
    std::size_t entries = in.integer<std::uint8_t>();
    if (entries > waypoints::max_entries || p.first + entries > p.count)
        in.fail(fmt::format("waypoints {} to {} of a list of {}", p.first, p.first + entries, p.count));
    for (std::size_t i = 0; i < entries && in.ok(); ++i) p.entries.push_back(in.point("waypoint"));
}

void write(writer& out, const configuration& p) {
    out.integer(p.revision);
    for (float value :
         {p.time_to_next_tack_s, p.forbidden_angle_upwind_deg, p.forbidden_angle_downwind_deg, p.leeway_compensation})
        out.real(value);
    for (float period : p.telemetry_period_s) out.real(period);
}
void read(reader& in, configuration& p) {
    p.revision = in.integer<std::uint16_t>();
    p.time_to_next_tack_s = in.real("time to next tack");
    p.forbidden_angle_upwind_deg = in.real("forbidden angle upwind");
    p.forbidden_angle_downwind_deg = in.real("forbidden angle downwind");
    p.leeway_compensation = in.real("leeway compensation");
    for (float& period : p.telemetry_period_s) period = in.real("telemetry period");
}

void write(writer& out, const link_status& p) {
    out.enumerator(p.link);
    out.integer(static_cast<std::uint8_t>(p.up ? 1 : 0));
    out.integer(p.rssi_dbm);
    out.integer(p.queued);
    out.integer(p.sent);
    out.integer(p.failed);
    out.integer(p.dropped);
    out.scaled<std::uint32_t>(p.last_heard_age_s, 0.1);
}
void read(reader& in, link_status& p) {
    p.link = in.enumerator<link_id>("link");
    p.up = in.integer<std::uint8_t>() != 0;
    p.rssi_dbm = in.integer<std::int16_t>();
    p.queued = in.integer<std::uint16_t>();
    p.sent = in.integer<std::uint32_t>();
    p.failed = in.integer<std::uint32_t>();
    p.dropped = in.integer<std::uint32_t>();
    p.last_heard_age_s = static_cast<float>(in.scaled<std::uint32_t>(0.1));
}

// Fits one radio frame also with a tag in place of the checksum.
constexpr std::size_t max_text_sent = 77;
void write(writer& out, const notice& p) { out.text(p.text, max_text_sent); }
void read(reader& in, notice& p) { p.text = in.text(notice::max_text); }

template <class P>
ise::result<telemetry_message> parse_as(reader& in) {
    P body;
    read(in, body);
    if (auto done = in.finish(); !done) return done.error();
    return telemetry_message{in.header, std::move(body)};
}

} // namespace

std::string_view name_of(const telemetry_body& body) noexcept {
    static constexpr std::array<std::string_view, 8> names{"location",  "navigation",    "wind",        "power",
                                                           "waypoints", "configuration", "link_status", "notice"};
    return names[body.index()];
}

ise::bytes encode_telemetry(const packet_header& header, const telemetry_body& body) {
    // A type's number is its place in telemetry_body, from 1.
    writer out(static_cast<std::uint8_t>(layout::first_telemetry + body.index()), header);
    std::visit([&](const auto& packet) { write(out, packet); }, body);
    return out.finish();
}

ise::result<telemetry_message> parse_telemetry(ise::bytes_view raw) {
    reader in(raw);
    if (!in.ok()) return in.finish().error();
    switch (in.type) {
        case 1: return parse_as<location>(in);
        case 2: return parse_as<navigation>(in);
        case 3: return parse_as<wind>(in);
        case 4: return parse_as<power>(in);
        case 5: return parse_as<waypoints>(in);
        case 6: return parse_as<configuration>(in);
        case 7: return parse_as<link_status>(in);
        case 8: return parse_as<notice>(in);
        default: return ise::failure(ise::errc::malformed, fmt::format("no telemetry packet has type {:02X}", in.type));
    }
}

} // namespace atirma
