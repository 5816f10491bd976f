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

} // namespace atirma::xbee
