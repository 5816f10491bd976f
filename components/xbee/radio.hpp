#pragma once
#include <ise/core/bytes.hpp>

#include <chrono>
#include <cstdint>

namespace atirma::xbee {

/// Time of the model since its start: whoever drives modem, ether and client decides how it passes.
using instant = std::chrono::nanoseconds;
inline constexpr instant never = instant::max();

enum class radio_kind : std::uint8_t { data, acknowledgement, remote_at, remote_at_answer };

/// What travels between emulated modems.
struct radio_packet {
    std::uint64_t source = 0;
    std::uint64_t destination = 0;
    std::uint64_t network = 0;  ///< the ID parameter
    std::uint32_t sequence = 0; ///< the same in every attempt
    radio_kind kind = radio_kind::data;
    ise::bytes payload;
};

/// One attempt on the air.
struct transmission {
    radio_packet packet;
    instant start{};
    instant end{};
    double power_dbm = 0;
};

/// (50 + n) bytes at 24 kbit/s, an attempt.
constexpr instant airtime(std::size_t payload) {
    return instant((50 + static_cast<std::int64_t>(payload)) * 1'000'000 / 3);
}
inline constexpr instant acknowledgement_airtime{6'666'667};

/// SplitMix64: the same numbers from every compiler.
class radio_random {
public:
    explicit radio_random(std::uint64_t seed) : state_(seed) {}
    std::uint64_t next() {
        std::uint64_t z = (state_ += 0x9E3779B97F4A7C15ull);
        z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ull;
        z = (z ^ (z >> 27)) * 0x94D049BB133111EBull;
        return z ^ (z >> 31);
    }
    double uniform() { return static_cast<double>(next() >> 11) * 0x1.0p-53; }
    /// Mean 0, deviation 1.
    double normal() {
        double sum = -6;
        for (int i = 0; i < 12; ++i) sum += uniform();
        return sum;
    }

private:
    std::uint64_t state_;
};

} // namespace atirma::xbee
