#pragma once
#include <components/boat/telemetry.hpp>

#include <deque>
#include <string>
#include <vector>

namespace atirma::simulator {

struct second_controller_options {
    double silence_s = 60;   ///< without a sign of life of the main controller: it has failed
    double period_s = 600;   ///< of the positions that it tells
    double battery_wh = 40;  ///< its own, charged while the main power is there
    double standby_w = 0.05; ///< what it draws while it only watches
    double beacon_w = 0.5;   ///< and on average while it tells the position
};

/// The boat's second controller: it watches the main one, and tells the position over a link and from a battery of its
/// own while that one or its power fails, or the emergency beacon is on. It has its own GPS, steers nothing and
/// obeys nobody but the main controller. Its packets are `location`, and `notice` with the cause; their boot is
/// `beacon_boot`, their sequence follows from the time, so that none repeats. Pure; `update` is called with each
/// step of the model.
class second_controller {
public:
    static constexpr std::size_t max_queued = 8; ///< packets; the oldest is dropped

    explicit second_controller(second_controller_options options = second_controller_options());

    struct observation {
        double now_s = 0; ///< model time
        bool main_runs = true;
        bool main_power = true;
        bool commanded = false; ///< the main controller has switched the beacon on
        location fix;
        utc_time clock{}; ///< by GPS
    };
    void update(const observation& now, double dt_s);

    /// Its own battery and link, as if cut off: it does nothing meanwhile.
    void set_power(bool on) noexcept { power_ = on; }
    bool has_power() const noexcept { return power_; }

    /// Oldest first.
    std::vector<ise::bytes> take_packets();
    bool transmits() const noexcept { return cause_ != cause::none; }
    double battery_percent() const noexcept;

private:
    enum class cause : std::uint8_t { none, commanded, silent, no_power };
    cause cause_of(const observation& now) const noexcept;
    std::string words(const observation& now) const;
    void say(const observation& now, const std::string& text);
    void tell_position(const observation& now);
    void put(ise::bytes raw);

    second_controller_options options_;
    std::deque<ise::bytes> queue_;
    cause cause_ = cause::none;
    double charge_wh_, heard_s_ = 0, next_s_ = 0;
    bool power_ = true;
};

} // namespace atirma::simulator
