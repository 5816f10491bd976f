#include <components/boat_simulator/boat_model.hpp>

#include <cmath>

namespace atirma::simulator {
namespace {

// The derivative of a state, in the shape of a state.
boat_state rate(const boat_state& s, const actuators& set, wind_vector w, const boat_parameters& p) {
    wind_vector ap = apparent_wind(s, w);
    double sail = sail_angle_rad(ap, set.sheet_rad);
    double sail_force = p.sail_lift * ap.speed_mps * std::sin(sail - ap.towards_rad);
    double rudder_force = p.rudder_lift * s.speed_mps * std::sin(set.rudder_rad);
    double v = s.speed_mps;
    double drag = p.drag * v * (p.signed_drag ? std::abs(v) : v);

    boat_state d;
    d.position_m.x = v * std::cos(s.heading_rad) + p.drift * w.speed_mps * std::cos(w.towards_rad);
    d.position_m.y = v * std::sin(s.heading_rad) + p.drift * w.speed_mps * std::sin(w.towards_rad);
    d.heading_rad = s.turn_rate_rps;
    d.speed_mps = (sail_force * std::sin(sail) - rudder_force * std::sin(set.rudder_rad) - drag) / p.mass;
    d.turn_rate_rps =
        ((p.sail_offset - p.mast_offset * std::cos(sail)) * sail_force -
         p.rudder_offset * std::cos(set.rudder_rad) * rudder_force - p.angular_friction * s.turn_rate_rps * v) /
        p.moment_of_inertia;
    // A sideways force of the sail to port heels the boat to port; the sail is to leeward, so the sign is that of the
    // force.
    d.heel_rad = s.heel_rate_rps;
    d.heel_rate_rps =
        (-p.heel_damping * s.heel_rate_rps + sail_force * p.sail_height_m * std::cos(sail) * std::cos(s.heel_rad) -
         p.heel_mass * 9.81 * p.righting_arm_m * std::sin(s.heel_rad)) /
        p.heel_inertia;
    return d;
}

boat_state add(const boat_state& s, const boat_state& d, double k) {
    boat_state out = s;
    out.position_m = s.position_m + k * d.position_m;
    out.heading_rad += k * d.heading_rad;
    out.speed_mps += k * d.speed_mps;
    out.turn_rate_rps += k * d.turn_rate_rps;
    out.heel_rad += k * d.heel_rad;
    out.heel_rate_rps += k * d.heel_rate_rps;
    return out;
}

boat_parameters make(std::array<double, 10> p, bool signed_drag) {
    boat_parameters out;
    out.drift = p[0], out.drag = p[1], out.angular_friction = p[2], out.sail_lift = p[3], out.rudder_lift = p[4];
    out.sail_offset = p[5], out.mast_offset = p[6], out.rudder_offset = p[7], out.mass = p[8],
    out.moment_of_inertia = p[9];
    out.signed_drag = signed_drag;
    return out;
}

} // namespace

boat_parameters published_parameters() { return make({0.1, 1, 6000, 1000, 2000, 1, 1, 2, 300, 10000}, false); }
boat_parameters small_boat_parameters() { return make({0.02, 20, 30, 6.5, 35, 0.15, 0.15, 0.9, 50, 20}, true); }

wind_vector apparent_wind(const boat_state& s, wind_vector w) {
    vec ap{w.speed_mps * std::cos(w.towards_rad - s.heading_rad) - s.speed_mps,
           w.speed_mps * std::sin(w.towards_rad - s.heading_rad)};
    return {length(ap), angle_rad(ap)};
}

double sail_angle_rad(wind_vector ap, double sheet_rad) {
    if (std::cos(ap.towards_rad) + std::cos(sheet_rad) < 0) return pi + ap.towards_rad;
    return std::sin(ap.towards_rad) > 0 ? -sheet_rad : sheet_rad;
}

boat_state step(const boat_state& s, const actuators& set, wind_vector w, const boat_parameters& p, double dt_s) {
    boat_state k1 = rate(s, set, w, p);
    boat_state k2 = rate(add(s, k1, dt_s / 2), set, w, p);
    boat_state k3 = rate(add(s, k2, dt_s / 2), set, w, p);
    boat_state k4 = rate(add(s, k3, dt_s), set, w, p);
    boat_state out = add(add(add(add(s, k1, dt_s / 6), k2, dt_s / 3), k3, dt_s / 3), k4, dt_s / 6);
    out.heading_rad = wrap_rad(out.heading_rad);
    return out;
}

} // namespace atirma::simulator
