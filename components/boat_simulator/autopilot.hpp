#pragma once
#include <components/boat/parameters.hpp>
#include <components/boat/telemetry.hpp>
#include <components/boat_simulator/line_follower.hpp>

#include <cstdint>
#include <map>
#include <vector>

namespace atirma::simulator {

/// The steering program on board: modes, the list of waypoints, the parameters. Without I/O; `update` is called at a
/// fixed step. Refusals have a message for the operator.
class autopilot {
public:
    static constexpr std::size_t max_waypoints = 100;

    /// Positions are metres around `home`.
    explicit autopilot(waypoint home);

    /// Rudder and sheet for the next step.
    actuators update(const boat_state& state, wind_vector wind, double leeway_rad, double dt_s);

    /// Where rudder and sheet were left by somebody else: in mode `manual` they stay there.
    void leave(const actuators& set) { last_.set = set; }

    void set_mode(sailing_mode mode, const boat_state& state, wind_vector wind);
    sailing_mode mode() const { return mode_; }
    /// Sails to that place and stays around it.
    void keep_station(waypoint place, const boat_state& state, wind_vector wind);

    const std::vector<waypoint>& list() const { return list_; }
    std::uint16_t revision() const { return revision_; } ///< of list and parameters: grows with each change
    std::uint8_t active() const { return active_; }
    std::uint16_t laps() const { return laps_; }
    ise::result<void> insert(std::size_t before, waypoint point, const boat_state& state);
    ise::result<void> erase(std::size_t index, const boat_state& state);
    ise::result<void> select(std::size_t index, const boat_state& state);
    void clear();
    /// Keeps a waypoint of a list to come; the one that was kept for that place is forgotten. Lost with a reboot.
    ise::result<void> stage(std::size_t index, waypoint point);
    /// The first `count` staged waypoints as a list. Errors: refused, with what is missing or differs.
    ise::result<std::vector<waypoint>> staged(std::size_t count, std::uint32_t checksum) const;
    /// Puts a list in the place of the present one, all or nothing, and forgets what is staged.
    void replace(std::vector<waypoint> list, const boat_state& state);
    void forget_staged() { staged_.clear(); }

    float parameter(parameter_id id) const; ///< 0 for a number without a name
    ise::result<void> set_parameter(parameter_id id, float value);

    /// Turns to the other side of the wind now; refused if the boat is not beating (`tack`) or not zigzagging downwind
    /// (`gybe`).
    ise::result<void> tack_now();
    ise::result<void> gybe_now();

    const steering& last() const { return last_; }
    vec target_m() const { return target_; }
    bool has_target() const { return has_target_; }
    follower_settings& follower() { return settings_; }

private:
    void aim(vec from, vec to);
    void aim_at_active(vec from);
    void aim_around_station(const boat_state& state, wind_vector wind);
    bool arrived(const boat_state& state, double radius_m) const;
    void on_arrival(const boat_state& state, wind_vector wind);
    ise::result<void> turn(bool possible, std::string_view what);

    local_chart chart_;
    follower_settings settings_;
    follower_state memory_;
    steering last_;
    sailing_mode mode_ = sailing_mode::automatic;
    std::vector<waypoint> list_;
    std::map<std::size_t, waypoint> staged_;
    float parameters_[parameter_count];
    std::uint16_t revision_ = 1, laps_ = 0;
    std::uint8_t active_ = 0;
    vec from_, target_, station_;
    double held_course_rad_ = 0;
    bool has_target_ = false, at_station_ = false, west_side_ = false;
};

} // namespace atirma::simulator
