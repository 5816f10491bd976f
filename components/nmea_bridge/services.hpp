#pragma once
#include <ise/session/contract.hpp>

#include <cstdint>
#include <string>

// What the NMEA bridge tells of itself.
namespace atirma {

/// One of its two outlets: NMEA 0183, or Signal K.
struct outlet_status {
    std::string listens;       ///< where TCP clients come to; empty: nowhere
    std::uint32_t clients = 0; ///< now
    std::uint64_t accepted = 0;
    std::uint64_t refused = 0;          ///< beyond the most
    std::uint64_t dropped_slow = 0;     ///< they did not take what was sent
    std::uint64_t messages = 0;         ///< given out, whoever listened
    std::uint64_t datagrams_failed = 0; ///< the system did not take them
};

struct bridge_status {
    outlet_status nmea;
    outlet_status signalk;
    std::uint64_t packets = 0; ///< of telemetry, from all proxies
    std::uint64_t malformed = 0;
    bool position_is_fresh = false;
};

namespace services {

/// Every five seconds.
inline constexpr ise::subscription<bridge_status> bridge{"bridge"};

} // namespace services

} // namespace atirma
