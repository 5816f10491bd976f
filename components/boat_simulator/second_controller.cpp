#include <components/boat_simulator/second_controller.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <utility>

namespace atirma::simulator {
namespace {

constexpr double charger_w = 5;
constexpr double short_break_s = 10; // of the main power: a loose contact is no emergency

// Two numbers a second, odd ones for notices: both may be of the same second. They suffice until 2088.
std::uint32_t sequence_of(utc_time at, bool is_notice) {
    constexpr std::chrono::sys_seconds begin{std::chrono::seconds(1'577'836'800)}; // 2020
    auto seconds = (std::chrono::floor<std::chrono::seconds>(at) - begin).count();
    return static_cast<std::uint32_t>(2 * seconds + (is_notice ? 1 : 0));
}

} // namespace

second_controller::second_controller(second_controller_options options)
    : options_(options), charge_wh_(options.battery_wh) {}

double second_controller::battery_percent() const noexcept { return 100 * charge_wh_ / options_.battery_wh; }

void second_controller::update(const observation& now, double dt_s) {
    if (now.main_runs) heard_s_ = now.now_s;
    double gained_w = now.main_power ? charger_w : 0, drawn_w = transmits() ? options_.beacon_w : options_.standby_w;
    charge_wh_ = std::clamp(charge_wh_ + (gained_w - drawn_w) * dt_s / 3600, 0.0, options_.battery_wh);
    if (!power_ || charge_wh_ <= 0) {
        cause_ = cause::none;
        queue_.clear();
        return;
    }
    auto before = std::exchange(cause_, cause_of(now));
    if (cause_ == cause::none) {
        if (before != cause::none) say(now, "the main controller is back: it tells the position no more");
        return;
    }
    if (cause_ != before) {
        say(now, words(now));
        next_s_ = now.now_s;
    }
    if (now.now_s < next_s_) return;
    next_s_ = now.now_s + options_.period_s;
    tell_position(now);
}

second_controller::cause second_controller::cause_of(const observation& now) const noexcept {
    double silent_s = now.now_s - heard_s_;
    if (!now.main_power && silent_s >= short_break_s) return cause::no_power;
    if (silent_s >= options_.silence_s) return cause::silent;
    return now.commanded ? cause::commanded : cause::none;
}

std::string second_controller::words(const observation& now) const {
    auto battery = fmt::format("; own battery {:.0f} %", battery_percent());
    switch (cause_) {
        case cause::no_power: return "main power lost" + battery;
        case cause::silent: return fmt::format("main controller silent for {:.0f} s", now.now_s - heard_s_) + battery;
        case cause::commanded: return "switched on by telecommand" + battery;
        case cause::none: break;
    }
    return {};
}

void second_controller::say(const observation& now, const std::string& text) {
    put(encode_telemetry({beacon_boot, sequence_of(now.clock, true), now.clock}, notice{"beacon: " + text}));
}

void second_controller::tell_position(const observation& now) {
    put(encode_telemetry({beacon_boot, sequence_of(now.clock, false), now.clock}, now.fix));
}

void second_controller::put(ise::bytes raw) {
    if (queue_.size() >= max_queued) queue_.pop_front();
    queue_.push_back(std::move(raw));
}

std::vector<ise::bytes> second_controller::take_packets() {
    std::vector<ise::bytes> all(queue_.begin(), queue_.end());
    queue_.clear();
    return all;
}

} // namespace atirma::simulator
