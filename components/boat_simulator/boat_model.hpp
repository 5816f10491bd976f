#pragma once
#include <components/boat_simulator/geometry.hpp>

#include <array>

namespace atirma::simulator {

/// The air over the water. Mathematical angle, direction **towards** which it blows.
struct wind_vector {
    double speed_mps = 0;
    double towards_rad = 0;
};

/// The state that the model integrates. Mathematical angles.
struct boat_state {
    vec position_m;
    double heading_rad = 0;
    double speed_mps = 0;
    double turn_rate_rps = 0;
    double heel_rad = 0; ///< starboard down positive
    double heel_rate_rps = 0;
};

struct actuators {
    double rudder_rad = 0; ///< positive turns the boat to starboard (the heading angle falls)
    double sheet_rad = 0;  ///< the largest angle of the sail that the sheet permits, 0 … π/2
};

/// Coefficients p1 … p10 of Jaulin's sailboat model and those of its heel.
struct boat_parameters {
    double drift = 0, drag = 0, angular_friction = 0, sail_lift = 0, rudder_lift = 0;            ///< p1 … p5
    double sail_offset = 0, mast_offset = 0, rudder_offset = 0, mass = 0, moment_of_inertia = 0; ///< p6 … p10
    bool signed_drag = true; ///< drag v|v| rather than v², so that it also slows a boat that moves backwards
    double heel_mass = 280, heel_inertia = 15, heel_damping = 40, sail_height_m = 2.1, righting_arm_m = 0.2;
};

/// The published values: the boat is much faster than real ones of its size.
boat_parameters published_parameters();
/// A boat of A-Tirma's size: 0.8, 1.15, 1.5 and 1.8 m/s at 3, 6, 10 and 14 m/s of wind.
boat_parameters small_boat_parameters();

/// The apparent wind, relative to the bow (mathematical angle, towards).
wind_vector apparent_wind(const boat_state& state, wind_vector true_wind);

/// The angle of the sail: to leeward up to its sheet, or luffing in the wind.
double sail_angle_rad(wind_vector apparent, double sheet_rad);

/// One step of the classical Runge–Kutta method, wind and actuators held. A pure function; steps of up to 0.1 s are
/// stable.
boat_state step(const boat_state& state, const actuators& set, wind_vector true_wind, const boat_parameters& p,
                double dt_s);

} // namespace atirma::simulator
