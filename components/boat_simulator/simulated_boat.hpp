#pragma once
#include <components/boat/telecommand.hpp>
#include <components/boat_simulator/autopilot.hpp>
#include <components/boat_simulator/boat_guard.hpp>
#include <components/boat_simulator/course.hpp>
#include <components/boat_simulator/second_controller.hpp>
#include <components/boat_simulator/telemetry_schedule.hpp>
#include <components/boat_simulator/wind_source.hpp>

#include <chrono>
#include <deque>
#include <memory>
#include <optional>
#include <string>

namespace atirma::simulator {

/// Time of the model since its start. The caller decides how fast it passes.
using model_time = std::chrono::nanoseconds;

/// The state of a boat over a loss of power, and its position then.
struct remembered_boat {
    std::uint16_t boot = 0;
    std::uint32_t authority = 0;
    waypoint home, place;
    double heading_rad = 0, speed_mps = 0, distance_m = 0;
    sailing_mode mode = sailing_mode::automatic;
    std::vector<waypoint> list;
    std::uint8_t active = 0;
    bool beacon = false;
    std::array<float, parameter_count> parameters{};
    std::array<std::optional<double>, link_count> telemetry_period_s{}; ///< those that a telecommand has set
};

struct boat_options {
    std::vector<waypoint> course;      ///< sailed in laps; empty: it stays at its position
    std::optional<waypoint> start;     ///< also home; else half-way along the last leg of the course
    std::optional<double> heading_deg; ///< default: on a reach, because a boat at rest head to wind never moves
    utc_time epoch{};                  ///< UTC at model time 0
    double clock_rate = 1;             ///< UTC that passes per model time; 1/speedup keeps the boat's clock right
    /// Error of the boat's clock, which then is not set by GPS; nothing: GPS sets it, and it is right.
    std::optional<std::chrono::milliseconds> clock_off;
    std::uint16_t boot = 1;
    std::array<double, link_count> telemetry_period_s{2, 0, 0}; ///< until a telecommand changes it; 0 is off
    std::optional<remembered_boat> resumed; ///< continues from there, in the next boot; `course`, `start` and
                                            ///< `boot` are ignored then
    std::vector<acknowledgement> executed; ///< telecommands of before, oldest first: repetitions of them change nothing
    std::uint64_t seed = 1;                ///< for the noise of the instruments
    boat_parameters model = small_boat_parameters();
    std::shared_ptr<const sea_limits> limits; ///< coast and fence; null: it knows none
    /// Nothing: it has none, and refuses to switch on the emergency beacon.
    std::optional<second_controller_options> second = second_controller_options();
    bool raw_telecommands = false; ///< whether raw telecommands go to its controller
};

/// Rudder and sheet as the remote control sets them.
struct remote_helm {
    double rudder_deg = 0; ///< -45 … 45, turns to starboard positive
    double sail_deg = 0;   ///< widest angle that the sheet allows, 0 … 90
};

/// The boat: hull, wind, autopilot, telemetry and telecommands. It uses no clock, and random numbers only from its
/// seed: the same options, commands and times give the same packets. Not thread-safe.
class simulated_boat {
public:
    static constexpr std::size_t max_queued = 128; ///< packets a link; the oldest is dropped and counted
    static constexpr std::size_t max_answers = 32; ///< acknowledgements a link; the oldest is dropped and counted
    static constexpr std::size_t remembered_commands = 256;
    /// An epoch of authority further above the boat's does not count.
    static constexpr std::uint32_t max_epoch_step = 1024;

    /// Throws `ise::error` (invalid_argument) without a wind.
    simulated_boat(boat_options options, std::shared_ptr<const wind_source> wind);

    /// Sails until `now` in steps of 0.1 s and queues the telemetry that is due. Time never goes back.
    void advance(model_time now);
    /// The time of its next step or packet; call `advance` then (or later, or more often).
    model_time next_event() const;

    /// The packets for one link: acknowledgements, then telemetry; each oldest first.
    std::vector<ise::bytes> take_packets(link_id link);
    /// The same one by one, for a sender with its own pace. Empty bytes if there is none.
    ise::bytes take_packet(link_id link);
    /// The telemetry without the acknowledgements, oldest first.
    std::deque<ise::bytes> take_telemetry(link_id link);
    double telemetry_period_s(link_id link) const { return schedule_.period_s(link); } ///< 0 is off
    std::size_t queued(link_id link) const {
        const auto& waiting = queues_[static_cast<std::size_t>(link)];
        return waiting.answers.size() + waiting.telemetry.size();
    }

    /// Processes a packet that arrived over a link: executes a telecommand and queues its acknowledgement on the same
    /// link. One without a validity is refused if it changes anything. Anything else is `malformed`, and counted. A
    /// boat that is starting ignores packets.
    ise::result<acknowledgement> on_packet(link_id link, ise::bytes_view raw);
    /// The same for a decoded telecommand. A repeated id gets the first answer again and changes nothing; one whose
    /// validity is over is not executed, and may come again under that id.
    acknowledgement execute(const telecommand& command, link_id from = link_id::xbee);

    /// The remote control takes rudder and sheet, or moves them; telecommands that steer are refused until it releases
    /// them (nothing). Then the boat sails on in its mode.
    void set_remote_control(std::optional<remote_helm> helm);
    const std::optional<remote_helm>& remote_control() const { return remote_; }

    /// The main power fails, or the main controller hangs: nobody steers, what waited for links is lost, and packets
    /// are ignored. When it works again it starts, in the next boot.
    void set_main_power(bool on);
    void set_main_controller(bool works);
    bool main_power() const { return main_power_; }
    bool main_controller() const { return main_works_; }
    bool fails() const { return !main_power_ || !main_works_; }
    /// Null: it has none.
    second_controller* second() { return second_ ? &*second_ : nullptr; }
    const second_controller* second() const { return second_ ? &*second_ : nullptr; }

    /// The state reported by the link's driver; sent in the next link_status packet.
    void set_link_status(const link_status& status);

    location location_now() const;
    navigation navigation_now() const;
    wind wind_now() const;
    power power_now() const;
    configuration configuration_now() const;
    bool in_irons() const { return irons_s_ > 8; }
    bool starting() const { return now_s_ < up_again_s_; }
    bool runs() const { return !fails() && !starting(); } ///< the main controller
    const boat_state& state() const { return state_; }
    const autopilot& pilot() const { return pilot_; }
    const local_chart& chart() const { return chart_; }
    wind_sample true_wind() const { return wind_->at(now_s_); }
    std::uint16_t boot() const { return boot_; }
    std::uint64_t refused_packets() const { return refused_; }
    /// The state to store, and to pass as `boat_options::resumed` and `executed` to the next boat.
    remembered_boat remember() const;
    const std::deque<acknowledgement>& executed() const { return acknowledged_; }
    std::uint64_t executed_count() const { return executed_count_; } ///< the number ever added to `executed()`
    const ise::bytes& last_raw() const { return last_raw_; }         ///< the payload of the last raw telecommand
    std::uint32_t authority() const { return authority_; }           ///< the epoch that it obeys; 0: any
    std::uint64_t late_count() const { return late_count_; }         ///< telecommands refused as expired
    /// By its own clock, which never goes back within a boot.
    utc_time clock_now() const;
    /// At model time `now` the clock that sets the boat's shows `utc`. The boat's follows it where that one is more
    /// than 1 s ahead, and never goes back. One with `clock_off` follows nothing.
    void follow_clock(model_time now, utc_time utc);

private:
    void resume(const remembered_boat& from);
    void sail(double dt_s);
    void obey_guard(wind_vector air);
    void observe_from_second(double dt_s);
    void start_again(reset_cause why);
    void set_failing(bool& what, bool works, reset_cause why);
    void set_commanded_period(link_id link, double period_s);
    void emit_due();
    void emit(link_id link, const telemetry_body& body);
    void emit(link_id link, packet_type type);
    void emit_waypoints(link_id link);
    void say(std::string text);
    void queue(link_id link, ise::bytes raw);
    void queue_answer(link_id link, const acknowledgement& answer);
    void put(link_id link, std::deque<ise::bytes>& to, std::size_t most, ise::bytes raw);
    packet_header next_header();
    bool obeys(std::uint32_t epoch) const;
    std::string lateness(const telecommand& command) const;
    acknowledgement late(const telecommand& command, std::string why);
    struct command_handlers;
    struct command_values;
    acknowledgement decide(const boat_command& command, std::uint32_t id, link_id from);

    boat_options options_;
    std::shared_ptr<const wind_source> wind_;
    local_chart chart_;
    autopilot pilot_;
    boat_guard guard_;
    telemetry_schedule schedule_;
    std::array<std::optional<double>, link_count> commanded_period_s_; // by a telecommand; the others are the options'
    boat_state state_;
    actuators set_;
    std::optional<remote_helm> remote_;
    std::optional<second_controller> second_;
    bool main_power_ = true, main_works_ = true;
    ise::bytes last_raw_;
    struct send_queue {
        std::deque<ise::bytes> answers, telemetry;
    };
    std::array<send_queue, link_count> queues_;
    std::array<link_status, link_count> links_;
    std::deque<acknowledgement> acknowledged_;
    double now_s_ = 0, up_again_s_ = -1, irons_s_ = 0, distance_m_ = 0, booted_s_ = 0, charge_ah_ = 17;
    vec ground_velocity_;
    double leeway_rad_ = 0;
    std::int64_t steps_ = 0;
    std::uint64_t refused_ = 0, executed_count_ = 0, late_count_ = 0;
    std::uint32_t sequence_ = 0, authority_ = 0;
    std::uint16_t boot_;
    reset_cause last_reset_ = reset_cause::power_on;
    bool beacon_ = false, was_in_irons_ = false;
};

} // namespace atirma::simulator
