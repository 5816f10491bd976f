#include <components/boat_simulator/simulated_boat.hpp>

#include <cmath>

// The bodies of the boat's telemetry; that of power is where the charge is.
namespace atirma::simulator {
namespace {

double bow_angle_deg(wind_vector apparent) { return -degrees(wrap_rad(apparent.towards_rad + pi)); }

} // namespace

location simulated_boat::location_now() const {
    location p;
    waypoint at = chart_.to_waypoint(state_.position_m);
    p.latitude_deg = at.latitude_deg;
    p.longitude_deg = at.longitude_deg;
    p.quality = fix_quality::simulated;
    p.satellites = 9;
    p.speed_over_ground_mps = static_cast<float>(length(ground_velocity_));
    p.course_over_ground_deg = static_cast<float>(compass_deg(angle_rad(ground_velocity_)));
    p.distance_sailed_m = static_cast<float>(distance_m_);
    return p;
}

navigation simulated_boat::navigation_now() const {
    navigation p;
    auto ap = apparent_wind(state_, to_vector(true_wind()));
    p.mode = pilot_.mode();
    p.on = ap.speed_mps < 0.1 ? tack::none : bow_angle_deg(ap) > 0 ? tack::starboard : tack::port;
    p.in_irons = in_irons();
    p.remote_control = remote_.has_value();
    p.beacon = beacon_;
    p.at_fence = guard_.at_fence();
    p.heading_deg = static_cast<float>(compass_deg(state_.heading_rad));
    p.heel_deg = static_cast<float>(degrees(state_.heel_rad));
    p.rudder_commanded_deg = p.rudder_measured_deg = static_cast<float>(degrees(set_.rudder_rad));
    p.sail_commanded_deg = static_cast<float>(degrees(set_.sheet_rad));
    p.sail_measured_deg = static_cast<float>(degrees(wrap_rad(sail_angle_rad(ap, set_.sheet_rad))));
    p.waypoint_count = static_cast<std::uint8_t>(pilot_.list().size());
    p.waypoint_index = pilot_.active();
    if (pilot_.has_target()) {
        vec to = pilot_.target_m() - state_.position_m;
        p.distance_to_waypoint_m = static_cast<float>(length(to));
        p.bearing_to_waypoint_deg = static_cast<float>(compass_deg(angle_rad(to)));
        p.cross_track_error_m = static_cast<float>(-pilot_.last().cross_track_m);
    }
    p.course_to_steer_deg = static_cast<float>(compass_deg(pilot_.last().course_rad));
    p.laps = pilot_.laps();
    return p;
}

wind simulated_boat::wind_now() const {
    auto sample = true_wind();
    auto ap = apparent_wind(state_, to_vector(sample));
    return {static_cast<float>(bow_angle_deg(ap)), static_cast<float>(ap.speed_mps),
            static_cast<float>(sample.from_deg), static_cast<float>(sample.speed_mps)};
}

configuration simulated_boat::configuration_now() const {
    configuration p;
    p.revision = pilot_.revision();
    p.time_to_next_tack_s = pilot_.parameter(parameter_id::time_to_next_tack);
    p.forbidden_angle_upwind_deg = pilot_.parameter(parameter_id::forbidden_angle_upwind);
    p.forbidden_angle_downwind_deg = pilot_.parameter(parameter_id::forbidden_angle_downwind);
    p.leeway_compensation = pilot_.parameter(parameter_id::leeway_compensation);
    for (std::size_t i = 0; i < link_count; ++i)
        p.telemetry_period_s[i] = static_cast<float>(schedule_.period_s(static_cast<link_id>(i)));
    return p;
}

} // namespace atirma::simulator
