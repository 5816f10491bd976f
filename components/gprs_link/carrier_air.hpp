#pragma once
#include <ise/core/time.hpp>

#include <algorithm>
#include <random>

namespace atirma {

/// How the carrier is now, and its dice: the same seed throws the same.
struct carrier_air {
    explicit carrier_air(std::uint64_t seed) : random(seed) {}

    bool up = true;
    ise::duration delay{};
    ise::duration jitter{};
    double loss = 0;
    std::mt19937_64 random;
    std::uint64_t bytes_up = 0, bytes_down = 0, datagrams_lost = 0, turned_away = 0, dropped = 0, address_changes = 0;

    /// 0 <= x < 1
    double throw_dice() { return static_cast<double>(random() >> 11) * 0x1.0p-53; }
    bool loses() { return throw_dice() < loss; }
    ise::duration flight() {
        auto extra = throw_dice() * static_cast<double>(jitter.count());
        return delay + ise::duration(static_cast<ise::duration::rep>(extra));
    }
};

} // namespace atirma
