#include <components/web_server/telemetry_feed.hpp>

namespace atirma {
namespace {

position_update page_view(const report_origin& from, const location& of) {
    position_update made;
    made.from = from;
    made.latitude_deg = of.latitude_deg;
    made.longitude_deg = of.longitude_deg;
    made.speed_over_ground_mps = of.speed_over_ground_mps;
    made.course_over_ground_deg = of.course_over_ground_deg;
    made.satellites = of.satellites;
    return made;
}

navigation_update page_view(const report_origin& from, const navigation& of) {
    navigation_update made;
    made.from = from;
    made.heading_deg = of.heading_deg;
    made.heel_deg = of.heel_deg;
    made.pitch_deg = of.pitch_deg;
    made.rudder_deg = of.rudder_measured_deg;
    made.course_to_steer_deg = of.course_to_steer_deg;
    made.cross_track_error_m = of.cross_track_error_m;
    if (of.waypoint_count > 0) made.active_waypoint = of.waypoint_index;
    return made;
}

wind_update page_view(const report_origin& from, const wind& of) {
    wind_update made;
    made.from = from;
    made.apparent_angle_deg = of.apparent_angle_deg;
    made.apparent_speed_mps = of.apparent_speed_mps;
    made.true_direction_deg = of.true_direction_deg;
    made.true_speed_mps = of.true_speed_mps;
    return made;
}

power_update page_view(const report_origin& from, const power& of) {
    power_update made;
    made.from = from;
    made.battery_voltage_v = of.battery_v;
    made.battery_current_a = of.battery_a;
    made.battery_charge_percent = of.battery_percent;
    return made;
}

} // namespace

std::vector<ise::sse_event> telemetry_feed::take(const telemetry_packet& packet, utc_ms now) {
    auto message = parse_telemetry(packet.raw);
    if (!message) return ++statistics_.malformed, std::vector<ise::sse_event>();
    if (!seen_.first_time(packet.boot, packet.sequence, packet.raw))
        return ++statistics_.duplicates, std::vector<ise::sse_event>();
    ++statistics_.received;
    auto kind = name_of(message->body);
    ++statistics_.by_type[std::string(kind)];
    auto events = show(packet, *message, now);
    if (on_new) on_new(packet, kind);
    return events;
}

void telemetry_feed::restore(const telemetry_packet& packet, utc_ms now) {
    auto message = parse_telemetry(packet.raw);
    if (message && seen_.first_time(packet.boot, packet.sequence, packet.raw)) show(packet, *message, now);
}

std::vector<ise::sse_event> telemetry_feed::show(const telemetry_packet& packet, const telemetry_message& message,
                                                 utc_ms now) {
    std::vector<ise::sse_event> events;
    report_origin from;
    from.measured_at = packet.measured_at;
    from.received_at = packet.received_at == utc_time() ? now : packet.received_at; // a proxy that does not say when
    bool beacon = packet.boot == beacon_boot;
    from.source = beacon ? "beacon" : name_of(packet.link);
    from.history = packet.history;
    if (!beacon && packet.boot != boot_) {
        boot_ = packet.boot;
        parts_.clear();
    }
    auto add = [&](std::optional<ise::sse_event> event) {
        if (event) events.push_back(std::move(*event));
    };
    const auto& body = message.body;
    if (const auto* l = std::get_if<location>(&body)) {
        if (!packet.history && !beacon) state_.on_report(packet.link, plausible_time(packet));
        if (has_fix(*l)) add(state_.apply(page_view(from, *l), now));
    } else if (const auto* n = std::get_if<navigation>(&body)) {
        add(state_.apply(page_view(from, *n), now));
        mode_update mode;
        mode.from = from;
        mode.mode = n->remote_control ? "remote_control" : name_of(n->mode);
        add(state_.apply(mode, now));
    } else if (const auto* w = std::get_if<wind>(&body)) {
        add(state_.apply(page_view(from, *w), now));
    } else if (const auto* p = std::get_if<power>(&body)) {
        add(state_.apply(page_view(from, *p), now));
    } else if (const auto* result = std::get_if<configuration>(&body)) {
        if (!packet.history && packet.measured_at >= configured_at_) {
            configured_at_ = packet.measured_at;
            state_.on_configuration(*result);
        }
    } else if (const auto* status = std::get_if<link_status>(&body)) {
        signal_update heard{from, std::string(name_of(status->link)), std::nullopt};
        if (status->rssi_dbm != 0) heard.rssi_dbm = status->rssi_dbm;
        add(state_.apply(heard, now));
    } else if (const auto* part = std::get_if<waypoints>(&body)) {
        add(waypoints_part(from, *part, now));
    }
    return events;
}

std::optional<ise::sse_event> telemetry_feed::waypoints_part(const report_origin& from, const waypoints& part,
                                                             utc_ms now) {
    if (part.revision != revision_) parts_.clear();
    revision_ = part.revision;
    for (std::size_t i = 0; i < part.entries.size(); ++i) parts_[part.first + i] = part.entries[i];
    while (!parts_.empty() && parts_.rbegin()->first >= part.count) parts_.erase(std::prev(parts_.end()));
    if (parts_.size() < part.count) return std::nullopt; // the rest is to come
    waypoints_update made;
    made.from = from;
    for (const auto& [index, at] : parts_) {
        track_waypoint shown;
        shown.latitude_deg = at.latitude_deg;
        shown.longitude_deg = at.longitude_deg;
        made.points.push_back(std::move(shown));
    }
    if (part.count > 0) made.active = part.active;
    made.closed = part.count > 2;
    return state_.apply(made, now);
}

} // namespace atirma
