#pragma once
#include <ise/session/contract.hpp>

#include <cstdint>
#include <optional>

namespace atirma {

/// Changes the air between the emulated modems; what is missing stays. An empty one only asks.
struct xbee_air_request {
    std::optional<bool> up;                    ///< false: nothing arrives any more
    std::optional<double> extra_loss;          ///< part of the packets that is lost at any distance, 0 … 1
    std::optional<double> shore_temperature_c; ///< above 60 the duty cycle is held over a second
};

struct xbee_air {
    bool up = true;
    double extra_loss = 0;
    double distance_m = 0;
    double strength_dbm = 0;       ///< mean, at that distance and full power
    double shore_duty_percent = 0; ///< used part of what is allowed
    double boat_duty_percent = 0;
    std::uint64_t delivered = 0; ///< packets and radio acknowledgements that arrived
    std::uint64_t lost = 0;
    std::uint64_t collided = 0;
    double model_time_s = 0;
};

namespace services {

/// Errors: refused (a number out of range).
inline constexpr ise::request_response<xbee_air_request, xbee_air> air_control{"air_control"};
inline constexpr ise::subscription<xbee_air> air{"air"};

} // namespace services

} // namespace atirma
