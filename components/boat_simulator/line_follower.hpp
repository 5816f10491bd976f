#pragma once
#include <components/boat_simulator/boat_model.hpp>

namespace atirma::simulator {

/// How the line is followed (Jaulin & Le Bars). Angles in radians.
struct follower_settings {
    double corridor_m = 30;               ///< r: half the width in which it beats
    double rudder_limit_rad = pi / 4;     ///< δr max
    double incidence_rad = pi / 4;        ///< γ: how steeply it comes back to the line
    double forbidden_upwind_rad = pi / 3; ///< ζ: closest to the wind that is sailed
    double forbidden_downwind_rad = 0;    ///< closest to dead downwind that is sailed; 0: it runs
    double time_to_next_tack_s = 0;       ///< shortest time on a tack while beating
};

/// What the follower remembers.
struct follower_state {
    double side = 1;     ///< q: which side of the wind it beats on, 1 or -1
    double held_s = 1e9; ///< how long the side has been held
    double forced_s = 0; ///< a commanded tack stays for so long whatever the line says
};

struct steering {
    double course_rad = 0;    ///< θ̄: the heading that is asked for
    double cross_track_m = 0; ///< left of the line positive
    bool beating = false;     ///< the line's own course is closer to the wind than it sails
    bool broad = false;       ///< it zigzags downwind
    actuators set;
};

/// Rudder and sheet for a heading. `wind` is the true one.
actuators steer_to(double course_rad, const boat_state& state, wind_vector wind, const follower_settings& s);

/// The heading nearest to `course_rad` that can be sailed; `side` breaks the tie.
double nearest_feasible_rad(double course_rad, wind_vector wind, double side, const follower_settings& s);

/// Follows the line from `a` to `b`. Pure but for the memory it is handed; `dt_s` since the last call.
/// `leeway_rad` is added to the course: what the caller wants compensated.
steering follow_line(vec a, vec b, const boat_state& state, wind_vector wind, const follower_settings& s,
                     double leeway_rad, follower_state& memory, double dt_s);

} // namespace atirma::simulator
