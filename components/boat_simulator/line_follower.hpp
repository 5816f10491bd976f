#pragma once
#include <components/boat_simulator/boat_model.hpp>

namespace atirma::simulator {

/// Parameters of the line following (Jaulin & Le Bars). Angles in radians.
struct follower_settings {
    double corridor_m = 30;               ///< r: half the width in which it beats
    double rudder_limit_rad = pi / 4;     ///< δr max
    double incidence_rad = pi / 4;        ///< γ: the angle at which it returns to the line
    double forbidden_upwind_rad = pi / 3; ///< ζ: the smallest angle to the wind that it sails
    double forbidden_downwind_rad = 0;    ///< the smallest angle to dead downwind that it sails; 0: it runs
    double time_to_next_tack_s = 0;       ///< shortest time on a tack while beating
};

/// The state of the follower.
struct follower_state {
    double side = 1;     ///< q: which side of the wind it beats on, 1 or -1
    double held_s = 1e9; ///< how long the side has been held
    double forced_s = 0; ///< for so long a commanded tack is held regardless of the line
};

struct steering {
    double course_rad = 0;    ///< θ̄: the commanded heading
    double cross_track_m = 0; ///< positive: left of the line
    bool beating = false;     ///< the line's own course is closer to the wind than it sails
    bool broad = false;       ///< it zigzags downwind
    actuators set;
};

/// Rudder and sheet for a heading. `wind` is the true one.
actuators steer_to(double course_rad, const boat_state& state, wind_vector wind, const follower_settings& s);

/// The heading nearest to `course_rad` that can be sailed; `side` breaks the tie.
double nearest_feasible_rad(double course_rad, wind_vector wind, double side, const follower_settings& s);

/// Follows the line from `a` to `b`. Pure except for the state passed in; `dt_s` since the last call. `leeway_rad`, the
/// leeway to compensate, is added to the course.
steering follow_line(vec a, vec b, const boat_state& state, wind_vector wind, const follower_settings& s,
                     double leeway_rad, follower_state& memory, double dt_s);

} // namespace atirma::simulator
