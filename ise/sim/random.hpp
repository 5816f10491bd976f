#pragma once
#include <cstdint>
#include <string_view>

namespace ise::sim {

/// A seeded generator (splitmix64) whose numbers are the same from every compiler. Every part of the world has
/// one of its own, derived from the world's seed and the part's name: what one part draws moves no other.
class generator {
public:
    explicit generator(std::uint64_t seed) noexcept : state_(seed) {}
    generator(std::uint64_t seed, std::string_view name) noexcept : state_(seed ^ 0x9E3779B97F4A7C15u) {
        for (char letter : name) {
            state_ ^= static_cast<unsigned char>(letter);
            state_ =
                next(); // mixed: the state alone only counts, and "boat0/boat0" would draw what "boat1/boat1" draws
        }
    }

    std::uint64_t next() noexcept {
        state_ += 0x9E3779B97F4A7C15u;
        std::uint64_t mixed = state_;
        mixed = (mixed ^ (mixed >> 30)) * 0xBF58476D1CE4E5B9u;
        mixed = (mixed ^ (mixed >> 27)) * 0x94D049BB133111EBu;
        return mixed ^ (mixed >> 31);
    }

    /// 0 <= result < bound; 0 where the bound is.
    std::uint64_t below(std::uint64_t bound) noexcept { return bound == 0 ? 0 : next() % bound; }

    /// True with this probability, 0..1.
    bool chance(double probability) noexcept {
        if (probability <= 0) return false;
        return static_cast<double>(next() >> 11) * 0x1.0p-53 < probability;
    }

private:
    std::uint64_t state_;
};

} // namespace ise::sim
