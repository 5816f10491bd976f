#include <components/web_server/track_state.hpp>

#include <components/web_server/track_json.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>

namespace atirma {

namespace {
constexpr std::size_t max_text = 64;
constexpr std::size_t max_sources = 16;
constexpr std::chrono::seconds beside{60}; ///< how far apart in time a fix and a wind may be to belong together

std::string bounded(std::string_view text) { return std::string(text.substr(0, max_text)); }

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
    return std::isfinite(latitude_deg) && std::isfinite(longitude_deg) && std::abs(latitude_deg) <= 90 && std::abs(longitude_deg) <= 180;
}
} // namespace

struct track_state::implementation {
    explicit implementation(track_options chosen) : options(std::move(chosen)), line(options.track) {}

    track_options options;
    track_line line;
    track_statistics statistics;
    std::uint64_t revision = 0;
    std::optional<position_update> position;
    std::optional<navigation_update> navigation;
    std::optional<wind_update> wind;
    std::optional<power_update> power;
    std::optional<waypoints_update> waypoints;
    std::optional<mode_update> mode;
    std::optional<utc_ms> leg_since; ///< when the active waypoint became it
    std::vector<std::string> sources;
    std::map<std::string, feed_update, std::less<>> feeds;
    std::map<std::string, utc_ms, std::less<>> heard; ///< last live report by link

    std::string id() const { return fmt::format("{}:{}", options.epoch, revision); }

    /// False (and counted) where the report cannot be used at all; otherwise its time and link are made sane.
    bool accept(report_origin& from) {
        if (from.measured_at - from.received_at > options.max_clock_lead) {
            from.measured_at = from.received_at;
            ++statistics.clock_corrected;
        }
        if (from.received_at - from.measured_at > options.max_age) return ++statistics.refused, false;
        from.source = bounded(from.source);
        ++statistics.accepted;
        if (!from.history && (heard.contains(from.source) || heard.size() < max_sources)) {
            auto& last = heard[from.source];
            last = std::max(last, from.received_at);
        }
        return true;
    }

    template <class Update>
    bool is_newer(const std::optional<Update>& current, const Update& update) {
        if (!current || update.from.measured_at > current->from.measured_at) return true;
        if (update.from.measured_at < current->from.measured_at) ++statistics.out_of_order;
        return false;
    }

    /// Where the gateway believed the boat to be says less than a fix of the boat's own that is not stale yet.
    bool would_blur(const position_update& update) const {
        auto rough = [this](const position_update& p) { return p.circular_error_m.value_or(0) > options.track.rough_fix_m; };
        return rough(update) && position && !rough(*position) && update.from.measured_at - position->from.measured_at <= options.stale_after;
    }

    std::uint32_t source_index(const std::string& source) {
        auto known = std::find(sources.begin(), sources.end(), source);
        if (known == sources.end()) {
            if (sources.size() >= max_sources) return static_cast<std::uint32_t>(sources.size() - 1);
            known = sources.insert(sources.end(), source);
        }
        return static_cast<std::uint32_t>(known - sources.begin());
    }

    std::optional<page_event> event(utc_ms now, json state, const track_point* point = nullptr) const {
        json data = {{"now", to_json(now)}, {"state", std::move(state)}};
        if (point) {
            data["points"] = json::array({to_json(*point)});
            data["state"]["sources"] = sources;
        }
        return page_event{id(), "update", to_text(data)};
    }

    json trip() const {
        if (line.points().empty()) return nullptr;
        const auto& first = line.points().front();
        return {{"started_at", to_json(first.at)}, {"last_at", to_json(line.points().back().at)}, {"distance_m", rounded(line.sailed_m(), 1)}};
    }

    /// The waypoint steered for, as seen from the newest position.
    json next_waypoint() const {
        if (!position || !waypoints || !waypoints->active || *waypoints->active >= waypoints->points.size()) return nullptr;
        const auto& target = waypoints->points[*waypoints->active];
        double there_m = distance_m(position->latitude_deg, position->longitude_deg, target.latitude_deg, target.longitude_deg);
        json next = {{"index", *waypoints->active},
                     {"count", waypoints->points.size()},
                     {"name", target.name},
                     {"distance_m", rounded(there_m, 1)},
                     {"bearing_deg", rounded(bearing_deg(position->latitude_deg, position->longitude_deg, target.latitude_deg, target.longitude_deg), 1)},
                     {"closing_mps", nullptr},
                     {"eta", nullptr}};
        if (auto closing = closing_mps(target, there_m)) {
            next["closing_mps"] = rounded(*closing, 2);
            constexpr double slowest_mps = 0.05;
            if (*closing > slowest_mps && there_m / *closing < 30 * 86400.0)
                next["eta"] = to_json(position->from.measured_at + std::chrono::milliseconds(std::llround(1000 * there_m / *closing)));
        }
        return next;
    }

    /// How fast the waypoint comes nearer. A boat that tacks does not point at it, so this is made good over the
    /// last minutes of the leg; at its beginning, the speed's part in that direction.
    std::optional<double> closing_mps(const track_waypoint& target, double there_m) const {
        auto now = position->from.measured_at;
        auto since = std::max(now - std::chrono::minutes(5), leg_since.value_or(utc_ms::min() + std::chrono::hours(1)));
        if (now - since >= beside) {
            auto then = line.before(since);
            if (then && since - then->at < beside) {
                double was_m = distance_m(then->latitude_deg, then->longitude_deg, target.latitude_deg, target.longitude_deg);
                return (was_m - there_m) * 1000 / static_cast<double>((now - then->at).count());
            }
        }
        if (!position->speed_over_ground_mps || !position->course_over_ground_deg) return std::nullopt;
        double towards = bearing_deg(position->latitude_deg, position->longitude_deg, target.latitude_deg, target.longitude_deg);
        return *position->speed_over_ground_mps * std::cos((towards - *position->course_over_ground_deg) * 0.017453292519943295);
    }

    void set_active(std::optional<std::size_t> active, utc_ms at) {
        if (active && *active >= waypoints->points.size()) active.reset();
        if (active != waypoints->active) leg_since = at;
        waypoints->active = active;
    }

    json feeds_json() const {
        json list = json::array();
        for (const auto& [source, feed] : feeds) list.push_back(to_json(feed));
        return list;
    }

    json heard_json() const {
        json all = json::object();
        for (const auto& [source, at] : heard) all[printable(source)] = to_json(at);
        return all;
    }
};

track_state::track_state(track_options options) : self_(std::make_unique<implementation>(std::move(options))) {}
track_state::~track_state() = default;
track_state::track_state(track_state&&) noexcept = default;
track_state& track_state::operator=(track_state&&) noexcept = default;

std::optional<page_event> track_state::apply(const position_update& given, utc_ms now) {
    auto& self = *self_;
    auto update = given;
    if (!on_earth(update.latitude_deg, update.longitude_deg)) return ++self.statistics.refused, std::nullopt;
    if (!self.accept(update.from)) return std::nullopt;
    keep_within(update.speed_over_ground_mps, 0, 60);
    keep_within(update.circular_error_m, 0, 1e6);
    normalise_direction(update.course_over_ground_deg);

    auto near = [&](const auto& other) {
        return other && std::chrono::abs(other->from.measured_at - update.from.measured_at) <= beside;
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
        state["position"] = to_json(*self.position);
        state["next"] = self.next_waypoint();
    }
    return self.event(now, std::move(state), placed);
}

std::optional<page_event> track_state::apply(const navigation_update& given, utc_ms now) {
    auto& self = *self_;
    auto update = given;
    if (!self.accept(update.from) || !self.is_newer(self.navigation, update)) return std::nullopt;
    normalise_direction(update.heading_deg);
    normalise_direction(update.course_to_steer_deg);
    keep_within(update.heel_deg, -180, 180);
    keep_within(update.pitch_deg, -90, 90);
    keep_within(update.rudder_deg, -90, 90);
    keep_within(update.cross_track_error_m, -1e6, 1e6);
    self.navigation = std::move(update);
    ++self.revision;
    json state = {{"navigation", to_json(*self.navigation)}, {"heard", self.heard_json()}};
    if (self.waypoints && self.navigation->active_waypoint && self.navigation->active_waypoint != self.waypoints->active &&
        self.navigation->from.measured_at >= self.waypoints->from.measured_at) {
        self.set_active(self.navigation->active_waypoint, self.navigation->from.measured_at);
        state["waypoints"] = to_json(*self.waypoints);
        state["next"] = self.next_waypoint();
    }
    return self.event(now, std::move(state));
}

std::optional<page_event> track_state::apply(const wind_update& given, utc_ms now) {
    auto& self = *self_;
    auto update = given;
    if (!self.accept(update.from)) return std::nullopt;
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
        point = self.line.annotate_wind(newest, *update.true_speed_mps, update.true_direction_deg, self.revision, beside);
    if (point && on_point) on_point(*point, self.sources[point->source]);
    if (newer) self.wind = std::move(update);
    if (!newer && !point) return std::nullopt;
    json state = {{"heard", self.heard_json()}};
    if (newer) state["wind"] = to_json(*self.wind);
    return self.event(now, std::move(state), point);
}

std::optional<page_event> track_state::apply(const power_update& given, utc_ms now) {
    auto& self = *self_;
    auto update = given;
    if (!self.accept(update.from) || !self.is_newer(self.power, update)) return std::nullopt;
    keep_within(update.battery_voltage_v, 0, 1000);
    keep_within(update.battery_current_a, -1000, 1000);
    keep_within(update.battery_charge_percent, 0, 100);
    self.power = std::move(update);
    ++self.revision;
    return self.event(now, {{"power", to_json(*self.power)}, {"heard", self.heard_json()}});
}

std::optional<page_event> track_state::apply(const waypoints_update& given, utc_ms now) {
    auto& self = *self_;
    auto update = given;
    bool sound = update.points.size() <= self.options.max_waypoints &&
                 std::all_of(update.points.begin(), update.points.end(),
                             [](const track_waypoint& w) { return on_earth(w.latitude_deg, w.longitude_deg); });
    if (!sound) return ++self.statistics.refused, std::nullopt;
    if (!self.accept(update.from) || !self.is_newer(self.waypoints, update)) return std::nullopt;
    for (auto& point : update.points) point.name = bounded(point.name);
    auto active = update.active;
    update.active = self.waypoints ? self.waypoints->active : std::nullopt;
    self.waypoints = std::move(update);
    self.set_active(active, self.waypoints->from.measured_at);
    ++self.revision;
    return self.event(now, {{"waypoints", to_json(*self.waypoints)}, {"next", self.next_waypoint()}, {"heard", self.heard_json()}});
}

std::optional<page_event> track_state::apply(const mode_update& given, utc_ms now) {
    auto& self = *self_;
    auto update = given;
    if (!self.accept(update.from) || !self.is_newer(self.mode, update)) return std::nullopt;
    update.mode = bounded(update.mode);
    self.mode = std::move(update);
    ++self.revision;
    return self.event(now, {{"mode", to_json(*self.mode)}, {"heard", self.heard_json()}});
}

std::optional<page_event> track_state::apply(const feed_update& given, utc_ms now) {
    auto& self = *self_;
    auto update = given;
    update.source = bounded(update.source);
    update.detail = bounded(update.detail);
    if (!self.feeds.contains(update.source) && self.feeds.size() >= max_sources) return ++self.statistics.refused, std::nullopt;
    if (update.last_heard && (self.heard.contains(update.source) || self.heard.size() < max_sources)) {
        auto& last = self.heard[update.source];
        last = std::max(last, *update.last_heard);
    }
    auto known = self.feeds.find(update.source);
    bool same = known != self.feeds.end() && known->second.connected == update.connected && known->second.detail == update.detail;
    if (same) return std::nullopt;
    if (known != self.feeds.end() && known->second.connected == update.connected) update.since = known->second.since;
    self.feeds.insert_or_assign(update.source, update);
    ++self.revision;
    return self.event(now, {{"feeds", self.feeds_json()}, {"heard", self.heard_json()}});
}

page_event track_state::snapshot(utc_ms now, std::string_view last_event_id) const {
    const auto& self = *self_;
    // An id of this epoch says what the client has; anything else (an older server's, a forged one) says nothing.
    std::uint64_t seen = 0;
    bool partial = false;
    if (last_event_id.starts_with(self.options.epoch + ":")) {
        auto number = last_event_id.substr(self.options.epoch.size() + 1);
        auto read = std::from_chars(number.data(), number.data() + number.size(), seen);
        partial = read.ec == std::errc() && read.ptr == number.data() + number.size() && seen <= self.revision;
    }
    json points = json::array();
    for (const auto& point : self.line.points())
        if (!partial || point.revision > seen) points.push_back(to_json(point));
    json state = {{"position", self.position ? to_json(*self.position) : json()},
                  {"navigation", self.navigation ? to_json(*self.navigation) : json()},
                  {"wind", self.wind ? to_json(*self.wind) : json()},
                  {"power", self.power ? to_json(*self.power) : json()},
                  {"waypoints", self.waypoints ? to_json(*self.waypoints) : json()},
                  {"mode", self.mode ? to_json(*self.mode) : json()},
                  {"next", self.next_waypoint()},
                  {"trip", self.trip()},
                  {"feeds", self.feeds_json()},
                  {"heard", self.heard_json()},
                  {"sources", self.sources}};
    json data = {{"now", to_json(now)},
                 {"boat", self.options.boat},
                 {"boat_id", self.options.id},
                 {"epoch", self.options.epoch},
                 {"stale_after_s", self.options.stale_after.count()},
                 {"status_period_s", self.options.status_period.count()},
                 {"max_points", self.options.track.max_points},
                 {"partial", partial},
                 {"columns", track_columns()},
                 {"points", std::move(points)},
                 {"state", std::move(state)}};
    return {self.id(), "snapshot", to_text(data)};
}

page_event track_state::status(utc_ms now) const {
    return {"", "status", to_text({{"now", to_json(now)}, {"state", {{"feeds", self_->feeds_json()}, {"heard", self_->heard_json()}}}})};
}

void track_state::restore(track_point fix, const std::string& link) {
    auto& self = *self_;
    fix.source = self.source_index(bounded(link));
    fix.revision = ++self.revision;
    self.line.insert(std::move(fix));
}

void track_state::restore_heard(const std::string& link, utc_ms at) {
    if (self_->heard.size() < max_sources) self_->heard[bounded(link)] = at;
}

void track_state::restore_sailed(double total_m) { self_->line.correct_sailed(total_m); }

const std::vector<track_point>& track_state::track() const noexcept { return self_->line.points(); }
const std::vector<std::string>& track_state::sources() const noexcept { return self_->sources; }
double track_state::sailed_m() const noexcept { return self_->line.sailed_m(); }
const std::vector<track_waypoint>& track_state::waypoints() const noexcept {
    static const std::vector<track_waypoint> none;
    return self_->waypoints ? self_->waypoints->points : none;
}
const std::optional<position_update>& track_state::position() const noexcept { return self_->position; }
const track_options& track_state::options() const noexcept { return self_->options; }
const track_statistics& track_state::statistics() const noexcept { return self_->statistics; }

} // namespace atirma
