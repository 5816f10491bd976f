#include <components/web_server/track_state.hpp>

#include <components/web_server/track_state_parts.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>

// What is known, as the page gets it.
namespace atirma {

std::optional<ise::sse_event> track_state_parts::event(utc_ms now, json state, const track_point* point) const {
    json data = {{"now", to_json(now)}, {"state", std::move(state)}};
    if (point) {
        data["points"] = json::array({to_json(*point)});
        data["state"]["sources"] = sources;
    }
    return ise::sse_event{id(), "update", to_text(data)};
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

void track_state_parts::remember(const std::string& quantity, utc_ms at, std::optional<double> value) {
    if (!value) return;
    auto& all = histories[quantity];
    auto place = std::lower_bound(all.begin(), all.end(), at, [](const auto& one, utc_ms t) { return one.first < t; });
    if (place != all.end() && place->first == at) return; // over another link
    all.insert(place, {at, *value});
    if (all.size() <= max_history) return;
    quantity_history kept;
    for (std::size_t i = 0; i < all.size(); ++i)
        if (i >= all.size() / 2 || i % 2 == 0) kept.push_back(all[i]);
    all = std::move(kept);
}

json track_state_parts::signals_json() const {
    json all = json::object();
    for (const auto& [link, signal] : signals)
        all[printable(link)] = {{"measured_at", to_json(signal.from.measured_at)}, {"rssi_dbm", *signal.rssi_dbm}};
    return all;
}

json track_state_parts::freshness_json() const {
    json all = json::object();
    auto pair = [](freshness_limits limits) { return json::array({limits.fresh_s, limits.stale_s}); };
    for (const auto& [name, link] : names_of<link_id>())
        all[std::string(name)] = {{"position", pair(rhythm.limits(value_kind::position, link))},
                                  {"wind", pair(rhythm.limits(value_kind::breeze, link))},
                                  {"power", pair(rhythm.limits(value_kind::supply, link))}};
    return all;
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

json track_state_parts::state_json() const {
    return {{"position", position ? to_json(*position) : json()},
            {"navigation", navigation ? to_json(*navigation) : json()},
            {"wind", wind ? to_json(*wind) : json()},
            {"power", power ? to_json(*power) : json()},
            {"waypoints", waypoints ? to_json(*waypoints) : json()},
            {"mode", mode ? to_json(*mode) : json()},
            {"next", next_waypoint()},
            {"trip", trip()},
            {"feeds", feeds_json()},
            {"signal", signals_json()},
            {"freshness", freshness_json()},
            {"heard", heard_json()},
            {"sources", sources}};
}

ise::sse_event track_state::snapshot(utc_ms now, std::string_view last_event_id) const {
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
    json data = {{"now", to_json(now)},
                 {"boat", self.options.boat},
                 {"boat_id", self.options.id},
                 {"epoch", self.options.epoch},
                 {"status_period_s", self.options.status_period.count()},
                 {"max_points", self.options.track.max_points},
                 {"partial", partial},
                 {"columns", track_columns()},
                 {"points", std::move(points)},
                 {"state", self.state_json()}};
    return {self.id(), "snapshot", to_text(data)};
}

ise::sse_event track_state::status(utc_ms now) const {
    return {"", "status",
            to_text({{"now", to_json(now)},
                     {"state",
                      {{"feeds", self_->feeds_json()},
                       {"heard", self_->heard_json()},
                       {"freshness", self_->freshness_json()}}}})};
}

std::string track_state::id() const { return self_->id(); }

std::string track_state::newest_text(utc_ms now, std::string_view track_id, std::string_view more) const {
    const auto& self = *self_;
    json data = {{"now", to_json(now)},
                 {"id", track_id},
                 {"boat", self.options.boat},
                 {"boat_id", self.options.id},
                 {"epoch", self.options.epoch},
                 {"status_period_s", self.options.status_period.count()},
                 {"max_points", self.options.track.max_points},
                 {"columns", track_columns()},
                 {"state", self.state_json()}};
    auto text = to_text(data);
    text.insert(1, more);
    return text;
}

std::string track_state::track_text() const {
    const auto& self = *self_;
    auto text = fmt::format(R"({{"id":"{}","epoch":"{}","columns":)", self.id(), self.options.epoch);
    append_columns(text, self.line.points());
    text += ",\"histories\":{";
    bool first = true;
    for (const auto& [quantity, values] : self.histories) {
        text += fmt::format(R"({}"{}":)", first ? "" : ",", printable(quantity));
        append_history(text, values);
        first = false;
    }
    return text + "}}";
}

void track_state::on_report(link_id link, utc_ms measured_at) noexcept { self_->rhythm.on_report(link, measured_at); }
void track_state::on_configuration(const configuration& result) noexcept { self_->rhythm.on_configuration(result); }

const report_rhythm& track_state::rhythm() const noexcept { return self_->rhythm; }

freshness_limits track_state::position_limits() const noexcept {
    auto link = self_->position ? from_name<link_id>(self_->position->from.source) : std::nullopt;
    return self_->rhythm.limits(value_kind::position, link.value_or(link_id::xbee));
}

void track_state::restore(track_point fix, const std::string& link) {
    auto& self = *self_;
    fix.source = self.source_index(bounded(link));
    fix.revision = ++self.revision;
    self.line.insert(std::move(fix));
}

void track_state::restore_heard(const std::string& link, utc_ms at, utc_ms now) {
    self_->note_heard(bounded(link), at, now);
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
