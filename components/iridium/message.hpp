#pragma once
#include <ise/core/bytes.hpp>
#include <ise/core/result.hpp>

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace atirma::iridium {

inline constexpr std::size_t max_mo_bytes = 340; ///< from a 9602
inline constexpr std::size_t max_mt_bytes = 270; ///< to a 9602

/// Where the gateway believes the modem to be: rough, within `cep_km` with a probability of one half.
struct estimate {
    double latitude_deg = 0;  ///< -90 … 90, north positive
    double longitude_deg = 0; ///< -180 … 180, east positive
    double cep_km = 0;
    bool operator==(const estimate&) const = default;
};

/// A mobile-originated message as the gateway tells it, by whichever path. (imei, momsn, session_time) is its identity:
/// the gateway repeats itself, and momsn wraps.
struct mo_message {
    std::string imei;
    std::uint16_t momsn = 0;
    std::chrono::sys_seconds session_time{};
    std::uint16_t mtmsn = 0; ///< of the MT message that the session took along; 0: none, or the path does not tell
    std::uint8_t session_status = 0;  ///< 0 … 2: the session went well; others came with what arrived all the same
    std::optional<std::uint32_t> cdr; ///< DirectIP's call record
    std::optional<estimate> where;
    ise::bytes data; ///< empty: the boat looked for messages only
    bool operator==(const mo_message&) const = default;
};

/// 15 digits. Error: malformed.
ise::result<void> check_imei(std::string_view imei);

/// What a session status of the gateway means: 10 → "timeout: the session ended too early".
std::string_view explain_session_status(unsigned status) noexcept;

} // namespace atirma::iridium
