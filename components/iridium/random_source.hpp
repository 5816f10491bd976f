#pragma once
#include <cstdint>

namespace atirma::iridium {

/// Random numbers of the emulations and of back-off: from a seed, the same everywhere (splitmix64).
class random_source {
public:
    explicit random_source(std::uint64_t seed) noexcept : state_(seed) {}

    std::uint64_t next() noexcept {
        state_ += 0x9E3779B97F4A7C15u;
        auto z = state_;
        z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
        z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
        return z ^ (z >> 31);
    }
    /// 0 <= x < 1
    double uniform() noexcept { return static_cast<double>(next() >> 11) * 0x1.0p-53; }
    double between(double low, double high) noexcept { return low + (high - low) * uniform(); }
    bool chance(double part) noexcept { return uniform() < part; }

private:
    std::uint64_t state_;
};

} // namespace atirma::iridium
