#pragma once
#include <components/boat/telemetry.hpp>

#include <ise/session/contract.hpp>

#include <optional>

// The services of the simulator itself, for tests, the link emulator and reports; a real boat has none of them.
namespace atirma {

/// The ground truth, without instruments and radio in between.
struct ground_truth {
    utc_time at{};           ///< by the clock of the simulator's host
    double model_time_s = 0; ///< since its start; passes `speedup` times as fast as the clock
    double latitude_deg = 0;
    double longitude_deg = 0;
    float speed_over_ground_mps = 0;
    float course_over_ground_deg = 0;
    float heading_deg = 0;
    float heel_deg = 0;
    float wind_speed_mps = 0;
    float wind_from_deg = 0;
    float distance_sailed_m = 0;
    sailing_mode mode = sailing_mode::manual;
    bool in_irons = false;
    std::uint8_t waypoint_index = 0;
    std::uint8_t waypoint_count = 0;
    std::uint16_t laps = 0;
    std::uint16_t boot = 0;
    bool modem_ready = false;
    std::uint64_t packets_sent = 0;   ///< acknowledged by the shore's modem
    std::uint64_t packets_failed = 0; ///< passed to the modem, and not acknowledged
    std::uint64_t packets_queued = 0;
    std::uint64_t radio_waiting = 0; ///< telemetry packets without a receipt of the shore over the radio
    std::uint64_t radio_sent_again = 0;
    std::uint64_t telecommands_heard = 0;
    std::uint64_t packets_refused = 0; ///< received, and not a telecommand
    bool gprs_connected = false;       ///< the shore has acknowledged a packet on this connection
    std::uint64_t gprs_waiting = 0;    ///< packets without the shore's acknowledgement
    std::uint64_t gprs_acknowledged = 0;
    std::uint64_t gprs_resent = 0;
    std::uint64_t gprs_dropped = 0; ///< discarded because the memory was full
    bool remote_control = false;    ///< it has rudder and sail
    bool main_power = true;
    bool main_controller = true;        ///< false: it hangs
    bool beacon_transmits = false;      ///< the second controller tells the position
    float beacon_battery_percent = 100; ///< of its own battery
    std::uint64_t beacon_messages = 0;  ///< at the gateway
};

/// Changes the scene while the boat sails; missing fields do not change. An empty one only returns the scene.
struct scene_request {
    std::optional<double> wind_speed_mps; ///< 0 … 40, constant from now on
    std::optional<double> wind_from_deg;  ///< true direction of its origin
    bool original_wind = false;           ///< back to the wind of the start
    std::optional<bool> radio_on;         ///< false: the boat neither sends nor receives
    /// True: the remote control takes rudder and sail, at first as they stand; false: it releases them.
    std::optional<bool> remote_control;
    std::optional<double> rudder_deg; ///< -45 … 45, turns to starboard positive; only of the remote control
    std::optional<double> sail_deg;   ///< 0 … 90, the sheet's widest angle; only of the remote control
    /// False: the main power fails, the main controller hangs, the second controller has no power; true: it is back.
    std::optional<bool> main_power, main_controller, beacon_power;
};
struct scene {
    double wind_speed_mps = 0;
    double wind_from_deg = 0;
    bool original_wind = true;
    bool radio_on = true;
    bool remote_control = false;
    double rudder_deg = 0; ///< as they stand, whoever steers
    double sail_deg = 0;
    bool main_power = true;
    bool main_controller = true;
    bool beacon_power = true;
};

namespace services {

inline constexpr ise::subscription<ground_truth> truth{"ground_truth"};
/// Errors: refused (a number out of range).
inline constexpr ise::request_response<scene_request, scene> scene_control{"scene"};

} // namespace services

} // namespace atirma
