#include <components/gui_client/course_watch.hpp>

#include <components/gui_client/freshness.hpp>
#include <components/gui_client/leg_check.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

namespace atirma::console {
namespace {

constexpr double slowest_mps = 0.15; // below, the course over ground means nothing
constexpr double makes_good_deg = 60;
constexpr double over_s = 720; // the alarm is over beyond this, so that it does not come and go at its limit
constexpr auto settles = std::chrono::seconds(10), clears = std::chrono::seconds(30);

double between_deg(double a, double b) { return std::abs(std::remainder(a - b, 360.0)); }

/// Where the boat goes, as a line from its position, `length_m` long at most.
std::vector<coast_point> path_ahead(const boat_view& boat, const mission_view& mission, double length_m) {
    const auto& at = boat.position->value;
    std::vector<coast_point> path{{at.latitude_deg, at.longitude_deg}};
    auto course = static_cast<double>(at.course_over_ground_deg);
    auto straight = [&] { path.push_back(flat_destination(path.back(), course, length_m)); };
    if (!boat.sailing) {
        straight();
        return path;
    }
    const auto& n = boat.sailing->value;
    auto to_mark_m = static_cast<double>(n.distance_to_waypoint_m);
    bool to_mark = n.mode == sailing_mode::automatic || n.mode == sailing_mode::return_home ||
                   n.mode == sailing_mode::station_keep;
    if (!to_mark || to_mark_m <= 0 ||
        between_deg(course, static_cast<double>(n.bearing_to_waypoint_deg)) > makes_good_deg) {
        straight();
        return path;
    }
    double leg_m = std::min(length_m, to_mark_m);
    path.push_back(flat_destination(path.back(), course, leg_m)); // it turns there at the latest
    length_m -= leg_m;
    const auto& list = mission.points;
    if (n.mode != sailing_mode::automatic || list.size() < 2 || n.waypoint_index >= list.size()) return path;
    path.back() = leg_m < to_mark_m ? path.back() : point_of(list[n.waypoint_index]);
    for (std::size_t i = n.waypoint_index; length_m > 0;) {
        i = (i + 1) % list.size();
        double next_m = std::max(1.0, flat_distance_m(path.back(), point_of(list[i])));
        path.push_back(point_of(list[i]));
        length_m -= next_m;
    }
    return path;
}

} // namespace

std::optional<double> seconds_to_land(const sea_limits& limits, const boat_view& boat, const mission_view& mission,
                                      utc_time now, double within_s) {
    if (!boat.position) return std::nullopt;
    auto speed = static_cast<double>(boat.position->value.speed_over_ground_mps);
    if (!(speed >= slowest_mps)) return std::nullopt;
    double age = std::min(age_s(now, boat.position->measured_at), 24 * 3600.0);
    auto path = path_ahead(boat, mission, speed * (within_s + age));
    double sailed_m = 0;
    for (std::size_t i = 0; i + 1 < path.size(); ++i) {
        if (auto land = limits.metres_to_land(path[i], path[i + 1])) {
            double left_s = (sailed_m + *land) / speed - age;
            if (left_s > within_s) return std::nullopt; // the last leg of the list reaches beyond
            return left_s;
        }
        sailed_m += flat_distance_m(path[i], path[i + 1]);
    }
    return std::nullopt;
}

void course_watch::apply(alarm_book& alarms, const boat_view& boat, const mission_view& mission, utc_time now) {
    if (!limits_ || !boat.position) return;
    const auto& at = boat.position->value;
    coast_point here{at.latitude_deg, at.longitude_deg};
    alarms.set("fence", !limits_->within_fence(here), severity::critical, "The boat is outside its fence", now);
    if (limits_->on_land(here))
        return alarms.raise("land", severity::critical,
                            "The boat's position is on land: it has run aground, or its "
                            "position is wrong",
                            now);
    auto left = seconds_to_land(*limits_, boat, mission, now, over_s);
    const auto* raised = alarms.find("land");
    bool is_raised = raised && !raised->over_at;
    bool near = left && *left <= (is_raised ? over_s : warn_s);
    if (!near) {
        since_.reset();
        if (!clear_since_) clear_since_ = now;
        if (is_raised && now - *clear_since_ >= clears) alarms.clear("land", now);
        return;
    }
    clear_since_.reset();
    if (!since_) since_ = now;
    if (!is_raised && *left > surely_s && now - *since_ < settles) return;
    auto minutes = std::max(0.0, *left / 60);
    alarms.raise("land", severity::critical,
                 *left < 0 ? fmt::format("The boat should have met land by now: course {:03.0f}°, last position {} ago",
                                         at.course_over_ground_deg, age_text(age_s(now, boat.position->measured_at)))
                           : fmt::format("Land in {:.0f} min on course {:03.0f}°, {:.1f} m/s: change the course",
                                         std::floor(minutes), at.course_over_ground_deg, at.speed_over_ground_mps),
                 now);
}

} // namespace atirma::console
