#include <components/web_server/track_state.hpp>

#include <components/web_server/track_state_parts.hpp>

#include <algorithm>
#include <cmath>

// What comes is judged, kept, and told on.
namespace atirma {
namespace {

void keep_within(std::optional<double>& value, double low, double high) {
    if (value && !(std::isfinite(*value) && *value >= low && *value <= high)) value.reset();
}

void normalise_direction(std::optional<double>& degrees) {
    keep_within(degrees, -3600, 3600);
    if (!degrees) return;
    double turned = std::fmod(*degrees, 360);
    if (turned < 0) turned += 360;
    degrees = turned >= 360 ? 0 : turned; // a tiny negative angle rounds up to the whole circle
}

bool on_earth(double latitude_deg, double longitude_deg) {
    return std::isfinite(latitude_deg) && std::isfinite(longitude_deg) && std::abs(latitude_deg) <= 90 &&
           std::abs(longitude_deg) <= 180;
}
} // namespace

bool track_state_parts::accept(report_origin& from, utc_ms now) {
    if (from.measured_at > from.received_at) { // so that it hides nothing that is measured afterwards
        from.measured_at = from.received_at;
        ++statistics.clock_corrected;
    }
    if (from.received_at - from.measured_at > options.max_age) return ++statistics.refused, false;
    from.source = bounded(from.source);
    ++statistics.accepted;
    if (!from.history) note_heard(from.source, from.received_at, now);
    return true;
}

void track_state_parts::note_heard(const std::string& source, utc_ms at, utc_ms now) {
    if (!heard.contains(source) && heard.size() >= max_track_sources) return;
    auto& last = heard[source];
    last = std::max(last, std::min(at, now)); // a clock of the shore may be ahead
}

bool track_state_parts::would_blur(const position_update& update) const {
    auto rough = [this](const position_update& p) {
        return p.circular_error_m.value_or(0) > options.track.rough_fix_m;
    };
    return rough(update) && position && !rough(*position) &&
           std::chrono::duration<double>(update.from.measured_at - position->from.measured_at).count() <
               limits_of(rhythm.position_s(from_name<link_id>(position->from.source).value_or(link_id::xbee))).stale_s;
}

std::uint32_t track_state_parts::source_index(const std::string& source) {
    auto known = std::find(sources.begin(), sources.end(), source);
    if (known == sources.end()) {
        if (sources.size() >= max_track_sources) return static_cast<std::uint32_t>(sources.size() - 1);
        known = sources.insert(sources.end(), source);
    }
    return static_cast<std::uint32_t>(known - sources.begin());
}

void track_state_parts::set_active(std::optional<std::size_t> active, utc_ms at) {
    if (active && *active >= waypoints->points.size()) active.reset();
    if (active != waypoints->active) leg_since = at;
    waypoints->active = active;
}

track_state::track_state(track_options options) : self_(std::make_unique<track_state_parts>(std::move(options))) {}
track_state::~track_state() = default;
track_state::track_state(track_state&&) noexcept = default;
track_state& track_state::operator=(track_state&&) noexcept = default;

std::optional<ise::sse_event> track_state::apply(const position_update& given, utc_ms now) {
    auto& self = *self_;
    auto update = given;
    if (!on_earth(update.latitude_deg, update.longitude_deg)) return ++self.statistics.refused, std::nullopt;
    if (!self.accept(update.from, now)) return std::nullopt;
    keep_within(update.speed_over_ground_mps, 0, 60);
    keep_within(update.circular_error_m, 0, 1e6);
    normalise_direction(update.course_over_ground_deg);

    auto near = [&](const auto& other) {
        return other && std::chrono::abs(other->from.measured_at - update.from.measured_at) <= match_window;
    };
    track_point point;
    point.at = update.from.measured_at;
    point.latitude_deg = update.latitude_deg;
    point.longitude_deg = update.longitude_deg;
    point.speed_mps = update.speed_over_ground_mps;
    point.course_deg = update.course_over_ground_deg;
    point.circular_error_m = update.circular_error_m;
    point.source = self.source_index(update.from.source);
    point.revision = ++self.revision;
    if (near(self.navigation)) {
        point.heading_deg = self.navigation->heading_deg;
        point.heel_deg = self.navigation->heel_deg;
    }
    if (near(self.wind)) {
        point.wind_speed_mps = self.wind->true_speed_mps;
        point.wind_direction_deg = self.wind->true_direction_deg;
    }
    bool newer = self.is_newer(self.position, update) && !self.would_blur(update);
    const auto* placed = self.line.insert(std::move(point));
    if (placed && on_point) on_point(*placed, self.sources[placed->source]);
    if (newer) self.position = std::move(update);
    if (!newer && !placed) return std::nullopt;
    json state = {{"trip", self.trip()}, {"heard", self.heard_json()}};
    if (newer) {
        state["freshness"] = self.freshness_json();
        state["position"] = to_json(*self.position);
        state["next"] = self.next_waypoint();
    }
    return self.event(now, std::move(state), placed);
}

std::optional<ise::sse_event> track_state::apply(const navigation_update& given, utc_ms now) {
    auto& self = *self_;
    auto update = given;
    if (!self.accept(update.from, now) || !self.is_newer(self.navigation, update)) return std::nullopt;
    normalise_direction(update.heading_deg);
    normalise_direction(update.course_to_steer_deg);
    keep_within(update.heel_deg, -180, 180);
    keep_within(update.pitch_deg, -90, 90);
    keep_within(update.rudder_deg, -90, 90);
    keep_within(update.cross_track_error_m, -1e6, 1e6);
    self.navigation = std::move(update);
    ++self.revision;
    json state = {{"navigation", to_json(*self.navigation)}, {"heard", self.heard_json()}};
    if (self.waypoints && self.navigation->active_waypoint &&
        self.navigation->active_waypoint != self.waypoints->active &&
        self.navigation->from.measured_at >= self.waypoints->from.measured_at) {
        self.set_active(self.navigation->active_waypoint, self.navigation->from.measured_at);
        state["waypoints"] = to_json(*self.waypoints);
        state["next"] = self.next_waypoint();
    }
    return self.event(now, std::move(state));
}

std::optional<ise::sse_event> track_state::apply(const wind_update& given, utc_ms now) {
    auto& self = *self_;
    auto update = given;
    if (!self.accept(update.from, now)) return std::nullopt;
    normalise_direction(update.apparent_angle_deg);
    if (update.apparent_angle_deg && *update.apparent_angle_deg > 180) *update.apparent_angle_deg -= 360;
    normalise_direction(update.true_direction_deg);
    keep_within(update.apparent_speed_mps, 0, 120);
    keep_within(update.true_speed_mps, 0, 120);
    auto newest = update.from.measured_at;
    bool newer = self.is_newer(self.wind, update);
    ++self.revision;
    const track_point* point = nullptr;
    if (update.true_speed_mps)
        point = self.line.annotate_wind(newest, *update.true_speed_mps, update.true_direction_deg, self.revision,
                                        match_window);
    if (point && on_point) on_point(*point, self.sources[point->source]);
    if (newer) self.wind = std::move(update);
    if (!newer && !point) return std::nullopt;
    json state = {{"heard", self.heard_json()}};
    if (newer) state["wind"] = to_json(*self.wind);
    return self.event(now, std::move(state), point);
}

std::optional<ise::sse_event> track_state::apply(const power_update& given, utc_ms now) {
    auto& self = *self_;
    auto update = given;
    if (!self.accept(update.from, now)) return std::nullopt;
    keep_within(update.battery_voltage_v, 0, 1000);
    keep_within(update.battery_current_a, -1000, 1000);
    keep_within(update.battery_charge_percent, 0, 100);
    self.remember("battery_charge_percent", update.from.measured_at, update.battery_charge_percent);
    self.remember("battery_voltage_v", update.from.measured_at, update.battery_voltage_v);
    self.remember("battery_current_a", update.from.measured_at, update.battery_current_a);
    if (!self.is_newer(self.power, update)) return std::nullopt;
    self.power = std::move(update);
    ++self.revision;
    return self.event(now, {{"power", to_json(*self.power)}, {"heard", self.heard_json()}});
}

std::optional<ise::sse_event> track_state::apply(const waypoints_update& given, utc_ms now) {
    auto& self = *self_;
    auto update = given;
    bool sound = update.points.size() <= self.options.max_waypoints &&
                 std::all_of(update.points.begin(), update.points.end(),
                             [](const track_waypoint& w) { return on_earth(w.latitude_deg, w.longitude_deg); });
    if (!sound) return ++self.statistics.refused, std::nullopt;
    if (!self.accept(update.from, now) || !self.is_newer(self.waypoints, update)) return std::nullopt;
    for (auto& point : update.points) point.name = bounded(point.name);
    auto active = update.active;
    update.active = self.waypoints ? self.waypoints->active : std::nullopt;
    self.waypoints = std::move(update);
    self.set_active(active, self.waypoints->from.measured_at);
    ++self.revision;
    return self.event(
        now, {{"waypoints", to_json(*self.waypoints)}, {"next", self.next_waypoint()}, {"heard", self.heard_json()}});
}

std::optional<ise::sse_event> track_state::apply(const mode_update& given, utc_ms now) {
    auto& self = *self_;
    auto update = given;
    if (!self.accept(update.from, now) || !self.is_newer(self.mode, update)) return std::nullopt;
    update.mode = bounded(update.mode);
    self.mode = std::move(update);
    ++self.revision;
    return self.event(now, {{"mode", to_json(*self.mode)}, {"heard", self.heard_json()}});
}

std::optional<ise::sse_event> track_state::apply(const signal_update& given, utc_ms now) {
    auto& self = *self_;
    auto update = given;
    update.link = bounded(update.link);
    auto known = self.signals.find(update.link);
    if (known == self.signals.end() && self.signals.size() >= max_track_sources)
        return ++self.statistics.refused, std::nullopt;
    if (!self.accept(update.from, now)) return std::nullopt;
    keep_within(update.rssi_dbm, -200, 50);
    if (!update.rssi_dbm) return std::nullopt;
    self.remember("signal_" + update.link, update.from.measured_at, update.rssi_dbm);
    if (known != self.signals.end() && known->second.from.measured_at >= update.from.measured_at) return std::nullopt;
    self.signals.insert_or_assign(update.link, update);
    ++self.revision;
    return self.event(now, {{"signal", self.signals_json()}, {"heard", self.heard_json()}});
}

std::optional<ise::sse_event> track_state::apply(const feed_update& given, utc_ms now) {
    auto& self = *self_;
    auto update = given;
    update.source = bounded(update.source);
    update.detail = bounded(update.detail);
    if (!self.feeds.contains(update.source) && self.feeds.size() >= max_track_sources)
        return ++self.statistics.refused, std::nullopt;
    if (update.last_heard) self.note_heard(update.source, *update.last_heard, now);
    auto known = self.feeds.find(update.source);
    bool same = known != self.feeds.end() && known->second.connected == update.connected &&
                known->second.detail == update.detail;
    if (same) return std::nullopt;
    if (known != self.feeds.end() && known->second.connected == update.connected) update.since = known->second.since;
    self.feeds.insert_or_assign(update.source, update);
    ++self.revision;
    return self.event(now, {{"feeds", self.feeds_json()}, {"heard", self.heard_json()}});
}

} // namespace atirma
