#include <components/boat_simulator/autopilot.hpp>

#include <components/boat/mission_checksum.hpp>

#include <fmt/format.h>

namespace atirma::simulator {
namespace {
constexpr double mark_radius_m = 15;
constexpr double station_radius_m = 12;
constexpr double station_reach_m = 40; // it sails back and forth across the wind, this far to each side
constexpr double forced_turn_s = 45;   // a commanded tack is held for at least this time
} // namespace

autopilot::autopilot(waypoint home) : chart_(home) {
    for (auto& info : parameters()) parameters_[static_cast<std::size_t>(info.id)] = info.initial;
}

actuators autopilot::update(const boat_state& state, wind_vector wind, double leeway_rad, double dt_s) {
    if (mode_ == sailing_mode::manual) return last_.set;
    if (mode_ == sailing_mode::hold) {
        last_ = {};
        last_.course_rad = wrap_rad(nearest_feasible_rad(held_course_rad_, wind, memory_.side, settings_));
        last_.set = steer_to(last_.course_rad, state, wind, settings_);
        return last_.set;
    }
    if (mode_ == sailing_mode::automatic && list_.empty()) { // nowhere to go: stay
        if (!at_station_ || !has_target_) {
            station_ = state.position_m;
            at_station_ = true;
            aim_around_station(state, wind);
        }
    } else if (mode_ == sailing_mode::automatic && !has_target_) {
        at_station_ = false;
        aim_at_active(state.position_m);
    }
    if (arrived(state, at_station_ ? station_radius_m : mark_radius_m)) on_arrival(state, wind);
    double leeway = parameter(parameter_id::leeway_compensation) * leeway_rad;
    last_ = follow_line(from_, target_, state, wind, settings_, leeway, memory_, dt_s);
    return last_.set;
}

void autopilot::set_mode(sailing_mode mode, const boat_state& state, wind_vector wind) {
    mode_ = mode;
    has_target_ = at_station_ = false;
    switch (mode) {
        case sailing_mode::manual: break;
        case sailing_mode::hold: held_course_rad_ = state.heading_rad; break;
        case sailing_mode::automatic:
            if (!list_.empty()) aim_at_active(state.position_m);
            break;
        case sailing_mode::return_home: aim(state.position_m, {0, 0}); break;
        case sailing_mode::station_keep:
            station_ = state.position_m;
            at_station_ = true;
            aim_around_station(state, wind);
            break;
    }
}

void autopilot::keep_station(waypoint place, const boat_state& state, wind_vector wind) {
    set_mode(sailing_mode::station_keep, state, wind);
    station_ = chart_.to_metres(place);
    aim_around_station(state, wind);
}

ise::result<void> autopilot::insert(std::size_t before, waypoint point, const boat_state& state) {
    if (list_.size() >= max_waypoints)
        return ise::failure(ise::errc::overloaded, fmt::format("the list is full: {} waypoints", max_waypoints));
    if (before > list_.size())
        return ise::failure(ise::errc::invalid_argument,
                            fmt::format("no place {} in a list of {}", before, list_.size()));
    bool keeps_active = !list_.empty();
    list_.insert(list_.begin() + static_cast<std::ptrdiff_t>(before), point);
    if (keeps_active && before <= active_) ++active_; // its destination stays the same
    ++revision_;
    laps_ = 0;
    if (mode_ == sailing_mode::automatic && !has_target_) aim_at_active(state.position_m);
    if (mode_ == sailing_mode::automatic) at_station_ = false;
    if (mode_ == sailing_mode::automatic && !keeps_active) aim_at_active(state.position_m);
    return {};
}

ise::result<void> autopilot::erase(std::size_t index, const boat_state& state) {
    if (index >= list_.size())
        return ise::failure(ise::errc::invalid_argument,
                            fmt::format("no waypoint {} in a list of {}", index, list_.size()));
    list_.erase(list_.begin() + static_cast<std::ptrdiff_t>(index));
    ++revision_;
    laps_ = 0;
    bool was_active = index == active_;
    if (index < active_) --active_;
    if (active_ >= list_.size()) active_ = 0;
    if (was_active) {
        if (mode_ == sailing_mode::automatic && list_.empty()) has_target_ = at_station_ = false;
        if (mode_ == sailing_mode::automatic && !list_.empty()) aim_at_active(state.position_m);
    }
    return {};
}

ise::result<void> autopilot::select(std::size_t index, const boat_state& state) {
    if (index >= list_.size())
        return ise::failure(ise::errc::invalid_argument,
                            fmt::format("no waypoint {} in a list of {}", index, list_.size()));
    active_ = static_cast<std::uint8_t>(index);
    if (mode_ == sailing_mode::automatic) aim_at_active(state.position_m);
    return {};
}

void autopilot::clear() {
    list_.clear();
    active_ = 0;
    laps_ = 0;
    ++revision_;
    if (mode_ == sailing_mode::automatic && list_.empty()) has_target_ = at_station_ = false;
}

ise::result<void> autopilot::stage(std::size_t index, waypoint point) {
    if (index >= max_waypoints)
        return ise::failure(ise::errc::invalid_argument, fmt::format("a list has {} waypoints at most", max_waypoints));
    staged_[index] = point;
    return {};
}

ise::result<std::vector<waypoint>> autopilot::staged(std::size_t count, std::uint32_t checksum) const {
    if (count > max_waypoints)
        return ise::failure(ise::errc::invalid_argument, fmt::format("a list has {} waypoints at most", max_waypoints));
    std::vector<waypoint> fresh;
    for (std::size_t i = 0; i < count; ++i) {
        auto found = staged_.find(i);
        if (found == staged_.end())
            return ise::failure(ise::errc::refused, fmt::format("waypoint {} of {} is not staged", i + 1, count));
        fresh.push_back(found->second);
    }
    if (mission_checksum(fresh) != checksum) return ise::failure(ise::errc::refused, "the staged list is another one");
    return fresh;
}

void autopilot::replace(std::vector<waypoint> list, const boat_state& state) {
    list_ = std::move(list);
    staged_.clear();
    active_ = 0;
    laps_ = 0;
    ++revision_;
    if (mode_ != sailing_mode::automatic) return;
    has_target_ = at_station_ = false;
    if (!list_.empty()) aim_at_active(state.position_m);
}

float autopilot::parameter(parameter_id id) const {
    auto index = static_cast<std::size_t>(id);
    return index < parameter_count ? parameters_[index] : 0.0f;
}

ise::result<void> autopilot::set_parameter(parameter_id id, float value) {
    if (auto good = check_parameter(id, value); !good) return good;
    parameters_[static_cast<std::size_t>(id)] = value;
    ++revision_;
    settings_.time_to_next_tack_s = parameter(parameter_id::time_to_next_tack);
    settings_.forbidden_upwind_rad = radians(parameter(parameter_id::forbidden_angle_upwind));
    settings_.forbidden_downwind_rad = radians(parameter(parameter_id::forbidden_angle_downwind));
    return {};
}

ise::result<void> autopilot::tack_now() { return turn(last_.beating, "tack"); }
ise::result<void> autopilot::gybe_now() { return turn(last_.broad, "gybe"); }

ise::result<void> autopilot::turn(bool possible, std::string_view what) {
    if (mode_ == sailing_mode::manual || mode_ == sailing_mode::hold)
        return ise::failure(ise::errc::refused, fmt::format("no {} in mode {}", what, name_of(mode_)));
    if (!possible) return ise::failure(ise::errc::refused, fmt::format("no {}: it sails straight for the mark", what));
    memory_.side = -memory_.side;
    memory_.held_s = 0;
    memory_.forced_s = std::max(forced_turn_s, settings_.time_to_next_tack_s);
    return {};
}

void autopilot::aim(vec from, vec to) {
    from_ = from;
    target_ = to;
    has_target_ = true;
}

void autopilot::aim_at_active(vec from) { aim(from, chart_.to_metres(list_[active_])); }

void autopilot::aim_around_station(const boat_state& state, wind_vector wind) {
    double across = wind.towards_rad + (west_side_ ? pi / 2 : -pi / 2);
    west_side_ = !west_side_;
    aim(state.position_m, station_ + station_reach_m * vec{std::cos(across), std::sin(across)});
}

bool autopilot::arrived(const boat_state& state, double radius_m) const {
    if (!has_target_) return false;
    if (length(state.position_m - target_) < radius_m) return true;
    vec leg = target_ - from_; // or it has passed the mark inside the corridor
    return dot(leg, state.position_m - target_) > 0 &&
           std::abs(det(leg, state.position_m - from_)) < 1.5 * settings_.corridor_m * length(leg);
}

void autopilot::on_arrival(const boat_state& state, wind_vector wind) {
    if (at_station_) return aim_around_station(state, wind);
    if (mode_ == sailing_mode::return_home) {
        station_ = {0, 0};
        at_station_ = true;
        return aim_around_station(state, wind);
    }
    vec mark = target_;
    if (active_ + 1u >= list_.size()) {
        active_ = 0;
        ++laps_;
    } else {
        ++active_;
    }
    if (list_.size() == 1) { // a single mark is a station
        station_ = mark;
        at_station_ = true;
        return aim_around_station(state, wind);
    }
    aim_at_active(mark);
}

} // namespace atirma::simulator
