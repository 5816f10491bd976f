#include <components/boat_simulator/wind_source.hpp>

#include <components/boat/random_source.hpp>

#include <algorithm>
#include <array>
#include <cmath>

namespace atirma::simulator {
namespace {

class constant final : public wind_source {
public:
    explicit constant(wind_sample w) : wind_(w) {}
    wind_sample at(double) const override { return wind_; }

private:
    wind_sample wind_;
};

// A sum of sines with random phases and periods: smooth and stateless, so it can be evaluated at any time.
class gusting final : public wind_source {
    struct wave {
        double rate_rps = 0;
        double phase_rad = 0;
    };
    using waves = std::array<wave, 6>;

public:
    gusting(wind_sample mean, std::uint64_t seed, gust_settings gusts) : mean_(mean), gusts_(gusts) {
        random_source random(seed);
        double slowest = std::max(gusts.period_s, 1.0);
        fill(speed_, slowest, random);
        fill(direction_, 4 * slowest, random); // shifts are slower than gusts
    }
    wind_sample at(double t) const override {
        double speed = mean_.speed_mps * (1 + gusts_.speed_deviation * sum(speed_, t));
        return {std::max(0.0, speed), wrap_deg(mean_.from_deg + gusts_.direction_deviation_deg * sum(direction_, t))};
    }

private:
    static void fill(waves& all, double period_s, random_source& random) {
        for (auto& w : all) {
            w = {2 * pi / (period_s * (0.7 + 0.6 * random.uniform())), 2 * pi * random.uniform()};
            period_s *= 0.7;
        }
    }
    static double sum(const waves& all, double t) {
        double total = 0;
        for (auto& w : all) total += std::sin(w.rate_rps * t + w.phase_rad);
        return total * std::sqrt(2.0 / static_cast<double>(all.size())); // deviation 1
    }
    wind_sample mean_;
    gust_settings gusts_;
    waves speed_, direction_;
};

} // namespace

wind_vector to_vector(wind_sample w) { return {w.speed_mps, from_compass_rad(w.from_deg + 180)}; }

std::unique_ptr<wind_source> constant_wind(wind_sample mean) { return std::make_unique<constant>(mean); }

std::unique_ptr<wind_source> gusting_wind(wind_sample mean, std::uint64_t seed, gust_settings gusts) {
    return std::make_unique<gusting>(mean, seed, gusts);
}

recorded_wind::recorded_wind(std::vector<entry> entries) : entries_(std::move(entries)) {
    if (entries_.empty()) throw ise::error(ise::errc::invalid_argument, "a recorded wind without entries");
    for (std::size_t i = 1; i < entries_.size(); ++i)
        if (!(entries_[i].time_s > entries_[i - 1].time_s))
            throw ise::error(ise::errc::invalid_argument, "the times of a recorded wind do not increase");
}

double recorded_wind::length_s() const { return entries_.back().time_s - entries_.front().time_s; }

wind_sample recorded_wind::at(double time_s) const {
    double length = length_s();
    if (length <= 0 || !std::isfinite(time_s)) return entries_.front().wind;
    double t = std::fmod(time_s, length);
    if (t < 0) t += length;
    t += entries_.front().time_s;
    auto next =
        std::upper_bound(entries_.begin(), entries_.end(), t, [](double x, const entry& e) { return x < e.time_s; });
    if (next == entries_.begin()) return entries_.front().wind;
    if (next == entries_.end()) return entries_.back().wind;
    auto& a = *(next - 1);
    double part = (t - a.time_s) / (next->time_s - a.time_s);
    double turn = std::remainder(next->wind.from_deg - a.wind.from_deg, 360.0);
    return {a.wind.speed_mps + part * (next->wind.speed_mps - a.wind.speed_mps),
            wrap_deg(a.wind.from_deg + part * turn)};
}

} // namespace atirma::simulator
