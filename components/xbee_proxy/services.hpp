#pragma once
#include <components/boat/link_seal.hpp>
#include <components/boat/services.hpp>

// What the XBee proxy provides besides telemetry, telecommand and telecommand_state.
namespace atirma {

/// The local modem and what came and went through it. Values that the modem has not told (yet) are missing.
struct xbee_local {
    bool port_open = false;
    bool modem_ready = false;
    std::string device;
    std::string trouble;       ///< why nothing can be sent now; empty where it can
    std::uint8_t api_mode = 0; ///< found out by itself
    std::optional<std::uint64_t> address;
    std::optional<std::int16_t> rssi_dbm; ///< of the last packet heard
    std::optional<std::int16_t> temperature_c;
    std::optional<std::uint8_t> duty_cycle_percent;       ///< used part of what is allowed
    std::optional<std::uint16_t> failed_deliveries;       ///< transmissions that exhausted their retries
    std::optional<std::uint16_t> failed_acknowledgements; ///< each cost a retry
    std::optional<std::uint8_t> power_level;              ///< 0 … 4
    std::optional<double> power_mw;
    std::optional<std::uint16_t> supply_mv;
    std::uint64_t port_openings = 0;
    std::uint64_t packets_received = 0; ///< of any kind, from the boat
    std::uint64_t telemetry_published = 0;
    std::uint64_t duplicates = 0;        ///< dropped
    std::uint64_t malformed = 0;         ///< bad checksum, unknown type…: dropped
    std::uint64_t foreign = 0;           ///< from another modem than the boat's: dropped
    std::uint64_t receipts_sent = 0;     ///< each for many packets of telemetry
    std::uint64_t telecommands_sent = 0; ///< attempts
    std::uint64_t telecommands_acknowledged = 0;
    std::uint64_t telecommands_open = 0;
    std::uint64_t frames = 0; ///< of the serial line
    std::uint64_t frames_refused = 0;
    std::uint64_t bytes_skipped = 0;
    link_seal seal;
};

/// Reads a parameter of the local modem, or sets it: `{"name":"power_level","value":2}`. Names are those of
/// `xbee_local` (power_level, temperature_c…) or the two letters of the AT command (PL, TP…).
struct xbee_param_request {
    std::string name;
    std::optional<std::uint64_t> value; ///< missing: it is read
};
struct xbee_param {
    std::string name;       ///< the two letters
    std::int64_t value = 0; ///< what holds now
    std::string text;       ///< the bytes of a text parameter
    std::string meaning;
};

namespace services {

inline constexpr ise::subscription<xbee_local> xb_local{"xb_local"};
/// Errors: refused (no such parameter, out of range, read only, no port, or the modem says no), handler_failed (no
/// answer: it may have been set).
inline constexpr ise::request_response<xbee_param_request, xbee_param> xb_local_param{"xb_local_param"};

} // namespace services

} // namespace atirma
