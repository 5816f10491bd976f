#pragma once
#include <cstdint>

namespace atirma {

/// SplitMix64: the same numbers from every compiler and library, unlike those of <random>'s distributions.
class random_source {
public:
    explicit constexpr random_source(std::uint64_t seed) noexcept : state_(seed) {}
    constexpr std::uint64_t next() noexcept {
        std::uint64_t z = (state_ += 0x9E3779B97F4A7C15ull);
        z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ull;
        z = (z ^ (z >> 27)) * 0x94D049BB133111EBull;
        return z ^ (z >> 31);
    }
    /// 0 <= x < 1.
    constexpr double uniform() noexcept { return static_cast<double>(next() >> 11) * 0x1.0p-53; }
    constexpr double between(double low, double high) noexcept { return low + (high - low) * uniform(); }
    constexpr bool chance(double part) noexcept { return uniform() < part; }
    /// Mean 0, deviation 1, never beyond ±6 (a sum of twelve uniform numbers).
    constexpr double normal() noexcept {
        double sum = -6;
        for (int i = 0; i < 12; ++i) sum += uniform();
        return sum;
    }

private:
    std::uint64_t state_;
};

} // namespace atirma
