#include <components/boat_simulator/line_follower.hpp>

#include <cmath>

namespace atirma::simulator {
namespace {

double sign(double x) { return x < 0 ? -1 : 1; }

void choose_side(double side, const follower_settings& s, follower_state& memory) {
    if (side == memory.side || memory.forced_s > 0 || memory.held_s < s.time_to_next_tack_s) return;
    memory.side = side;
    memory.held_s = 0;
}

} // namespace

actuators steer_to(double course_rad, const boat_state& state, wind_vector wind, const follower_settings& s) {
    double off = state.heading_rad - course_rad;
    actuators set;
    set.rudder_rad = std::cos(off) >= 0 ? s.rudder_limit_rad * std::sin(off) : s.rudder_limit_rad * sign(std::sin(off));
    set.sheet_rad = pi / 4 * (std::cos(wind.towards_rad - course_rad) + 1);
    return set;
}

double nearest_feasible_rad(double course_rad, wind_vector wind, double side, const follower_settings& s) {
    double off = wrap_rad(course_rad - (wind.towards_rad + pi)); // from the direction of the wind
    if (std::abs(off) < s.forbidden_upwind_rad)
        return wind.towards_rad + pi + (off == 0 ? -side : sign(off)) * s.forbidden_upwind_rad;
    double run = wrap_rad(course_rad - wind.towards_rad);
    if (std::abs(run) < s.forbidden_downwind_rad)
        return wind.towards_rad + (run == 0 ? side : sign(run)) * s.forbidden_downwind_rad;
    return course_rad;
}

steering follow_line(vec a, vec b, const boat_state& state, wind_vector wind, const follower_settings& s,
                     double leeway_rad, follower_state& memory, double dt_s) {
    memory.held_s += dt_s;
    memory.forced_s = std::max(0.0, memory.forced_s - dt_s);

    vec leg = b - a;
    double leg_length = length(leg);
    steering out;
    if (leg_length < 1e-6) { // no line: straight to the point
        leg = b - state.position_m;
        leg_length = std::max(length(leg), 1e-6);
        a = state.position_m;
    }
    double e = det((1 / leg_length) * leg, state.position_m - a);
    double along = angle_rad(leg);
    double wanted = along - 2 * s.incidence_rad / pi * std::atan(e / s.corridor_m);
    if (std::abs(e) > s.corridor_m / 2) choose_side(sign(e), s, memory);

    double zeta = std::cos(s.forbidden_upwind_rad);
    bool upwind = std::cos(wind.towards_rad - wanted) + zeta < 0;
    bool line_upwind = std::abs(e) < s.corridor_m && std::cos(wind.towards_rad - along) + zeta < 0;
    double run = std::cos(s.forbidden_downwind_rad);
    bool downwind =
        s.forbidden_downwind_rad > 0 && (std::cos(wind.towards_rad - wanted) > run ||
                                         (std::abs(e) < s.corridor_m && std::cos(wind.towards_rad - along) > run));
    out.cross_track_m = e;
    if (upwind || line_upwind) {
        out.beating = true;
        out.course_rad = pi + wind.towards_rad - memory.side * s.forbidden_upwind_rad;
    } else if (downwind) {
        out.broad = true;
        out.course_rad = wind.towards_rad - memory.side * s.forbidden_downwind_rad;
    } else {
        out.course_rad = wanted + leeway_rad;
    }
    out.course_rad = wrap_rad(out.course_rad);
    out.set = steer_to(out.course_rad, state, wind, s);
    return out;
}

} // namespace atirma::simulator
