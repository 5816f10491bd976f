#pragma once
#include <ise/session/contract.hpp>

#include <cstdint>
#include <optional>
#include <string>

namespace atirma {

/// Changes the emulated modem's sky; what is missing stays. An empty one only asks.
struct iridium_sky_request {
    std::optional<bool> free;       ///< false: no satellite is seen, sessions end with status 32
    std::optional<double> failures; ///< part of the sessions that fail on the radio link, 0 … 1
    std::optional<int> fail_next;   ///< the next session ends with this MO status (10 … 65)
};
struct iridium_sky {
    bool free = true;
    double failures = 0;
    bool port_in_use = false; ///< somebody has written to it
    std::uint16_t momsn = 0;  ///< of the next message
    std::uint64_t sessions = 0;
    std::uint64_t sessions_failed = 0;
    std::uint64_t messages_sent = 0;
    std::uint64_t messages_received = 0;
    std::uint64_t rings = 0;
    std::string last_session; ///< "+SBDIX: …", and what it means
};

namespace services {

/// Errors: refused (a number out of range).
inline constexpr ise::request_response<iridium_sky_request, iridium_sky> iridium_sky_control{"iridium_sky_control"};
inline constexpr ise::subscription<struct iridium_sky> iridium_sky{"iridium_sky"};

} // namespace services

} // namespace atirma
