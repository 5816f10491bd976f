#include <components/web_server/track_state.hpp>

#include <components/web_server/track_state_parts.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>

// What is known, as the page gets it.
namespace atirma {

std::optional<sse_event> track_state_parts::event(utc_ms now, json state, const track_point* point) const {
    json data = {{"now", to_json(now)}, {"state", std::move(state)}};
    if (point) {
        data["points"] = json::array({to_json(*point)});
        data["state"]["sources"] = sources;
    }
    return sse_event{id(), "update", to_text(data)};
}

json track_state_parts::trip() const {
    if (line.points().empty()) return nullptr;
    const auto& first = line.points().front();
    return {{"started_at", to_json(first.at)},
            {"last_at", to_json(line.points().back().at)},
            {"distance_m", rounded(line.sailed_m(), 1)}};
}

json track_state_parts::next_waypoint() const {
    if (!position || !waypoints || !waypoints->active || *waypoints->active >= waypoints->points.size()) return nullptr;
    const auto& target = waypoints->points[*waypoints->active];
    double there_m =
        distance_m(position->latitude_deg, position->longitude_deg, target.latitude_deg, target.longitude_deg);
    json next = {{"index", *waypoints->active},
                 {"count", waypoints->points.size()},
                 {"name", target.name},
                 {"distance_m", rounded(there_m, 1)},
                 {"bearing_deg", rounded(bearing_deg(position->latitude_deg, position->longitude_deg,
                                                     target.latitude_deg, target.longitude_deg),
                                         1)},
                 {"closing_mps", nullptr},
                 {"eta", nullptr}};
    if (auto closing = closing_mps(target, there_m)) {
        next["closing_mps"] = rounded(*closing, 2);
        constexpr double slowest_mps = 0.05;
        if (*closing > slowest_mps && there_m / *closing < 30 * 86400.0)
            next["eta"] = to_json(position->from.measured_at +
                                  std::chrono::milliseconds(std::llround(1000 * there_m / *closing)));
    }
    return next;
}

std::optional<double> track_state_parts::closing_mps(const track_waypoint& target, double there_m) const {
    auto now = position->from.measured_at;
    auto since = std::max(now - std::chrono::minutes(5), leg_since.value_or(utc_ms::min() + std::chrono::hours(1)));
    if (now - since >= match_window) {
        auto then = line.before(since);
        if (then && since - then->at < match_window) {
            double was_m =
                distance_m(then->latitude_deg, then->longitude_deg, target.latitude_deg, target.longitude_deg);
            return (was_m - there_m) * 1000 / static_cast<double>((now - then->at).count());
        }
    }
    if (!position->speed_over_ground_mps || !position->course_over_ground_deg) return std::nullopt;
    double towards =
        bearing_deg(position->latitude_deg, position->longitude_deg, target.latitude_deg, target.longitude_deg);
    return *position->speed_over_ground_mps *
           std::cos((towards - *position->course_over_ground_deg) * 0.017453292519943295);
}

json track_state_parts::feeds_json() const {
    json list = json::array();
    for (const auto& [source, feed] : feeds) list.push_back(to_json(feed));
    return list;
}

json track_state_parts::heard_json() const {
    json all = json::object();
    for (const auto& [source, at] : heard) all[printable(source)] = to_json(at);
    return all;
}

sse_event track_state::snapshot(utc_ms now, std::string_view last_event_id) const {
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

sse_event track_state::status(utc_ms now) const {
    return {
        "", "status",
        to_text({{"now", to_json(now)}, {"state", {{"feeds", self_->feeds_json()}, {"heard", self_->heard_json()}}}})};
}

void track_state::restore(track_point fix, const std::string& link) {
    auto& self = *self_;
    fix.source = self.source_index(bounded(link));
    fix.revision = ++self.revision;
    self.line.insert(std::move(fix));
}

void track_state::restore_heard(const std::string& link, utc_ms at) {
    if (self_->heard.size() < max_track_sources) self_->heard[bounded(link)] = at;
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
