#include <ise/transport/udp/congestion.hpp>

#include <algorithm>

namespace ise::net::udp {
namespace {

using namespace std::chrono_literals;

constexpr duration first_time_out = 300ms;
constexpr duration min_time_out = 10ms;
// Receivers wait this long with an ack at most, and coarse clocks and busy loops are somewhat late.
constexpr duration ack_delay = 20ms;

} // namespace

void congestion::sample(duration round_trip, duration delayed_there) noexcept {
    if (round_trip <= duration{}) round_trip = duration(1);
    if (delayed_there < round_trip / 2) round_trip -= delayed_there;
    latest_ = round_trip;
    if (!measured()) {
        smoothed_ = round_trip;
        deviation_ = round_trip / 2;
        return;
    }
    auto away = smoothed_ > round_trip ? smoothed_ - round_trip : round_trip - smoothed_;
    deviation_ += (away - deviation_) / 4;
    smoothed_ += (round_trip - smoothed_) / 8;
}

void congestion::on_sent(std::size_t bytes, time_point now) noexcept {
    paced_until(now); // brings the budget up to date
    budget_ -= static_cast<double>(bytes);
    in_flight_ += bytes;
}

void congestion::on_acked(std::size_t bytes, bool window_was_used) noexcept {
    forget(bytes);
    if (!window_was_used) return; // what was not used was not proved
    window_ += window_ < threshold_ ? bytes : datagram * bytes / window_;
    window_ = std::min(window_, most_);
}

void congestion::limit(std::size_t most) noexcept {
    most_ = std::clamp(most, min_window, max_window);
    window_ = std::min(window_, most_);
}

void congestion::on_lost(std::size_t bytes, std::uint64_t number, std::uint64_t next) noexcept {
    forget(bytes);
    if (number < recovering_until_) return;
    recovering_until_ = next;
    window_ = std::max(window_ * 7 / 10, min_window);
    threshold_ = window_;
}

time_point congestion::paced_until(time_point now) noexcept {
    // Short ways need no pace: what leaves in a burst is there before the next one.
    if (smoothed_ < 2ms) {
        budget_ = burst;
        return now;
    }
    double rate = 1.25 * static_cast<double>(window_) / static_cast<double>(smoothed_.count()); // bytes a nanosecond
    if (budget_at_ != time_point{} && now > budget_at_)
        budget_ += rate * static_cast<double>((now - budget_at_).count());
    budget_at_ = now;
    budget_ = std::min(budget_, static_cast<double>(burst));
    if (budget_ >= 1) return now;
    auto wait = duration(static_cast<duration::rep>(std::min((1 - budget_) / rate, 1e9))) + 1ns;
    return now + std::max<duration>(wait, 200us);
}

duration congestion::time_out() const noexcept {
    if (!measured()) return first_time_out;
    return smoothed_ + std::max<duration>(4 * deviation_, min_time_out) + ack_delay;
}

duration congestion::reordering() const noexcept {
    return std::max<duration>(std::max(smoothed_, latest_) * 9 / 8, 1ms);
}

} // namespace ise::net::udp
