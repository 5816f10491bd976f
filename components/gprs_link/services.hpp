#pragma once
#include <ise/session/contract.hpp>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace atirma {

/// Changes what lies between boat and proxy; what is missing stays. An empty one only asks.
struct carrier_request {
    std::optional<bool> up; ///< false: nothing passes; connections stall, new ones are turned away, datagrams are lost
    std::optional<double> outage_s; ///< down from now on for so long, then up by itself, 0 … 86400
    std::optional<double> delay_s;  ///< each way, 0 … 600
    std::optional<double> jitter_s; ///< added to it at most, 0 … 600; datagrams overtake each other
    std::optional<double> loss;     ///< part of the datagrams, 0 … 1
    bool drop = false;              ///< the connections of now break
    bool half_open = false;      ///< the connections of now carry nothing any more, and nobody is told; new ones work
    bool change_address = false; ///< the boat comes from another port; its connections of now break by that
};

struct carrier_state {
    std::vector<std::string> listening; ///< endpoints that the boat calls
    bool up = true;
    double outage_left_s = 0; ///< until it is up by itself; 0: no outage with an end
    double delay_s = 0;
    double jitter_s = 0;
    double loss = 0;
    std::uint64_t connections = 0; ///< now, half open ones included
    std::uint64_t half_open = 0;   ///< of these
    std::uint64_t turned_away = 0; ///< connections made while it was down, or that found no proxy
    std::uint64_t dropped = 0;     ///< connections that it broke
    std::uint64_t address_changes = 0;
    std::uint64_t bytes_up = 0; ///< carried to the proxy
    std::uint64_t bytes_down = 0;
    std::uint64_t datagrams_lost = 0;
    std::uint64_t held_bytes = 0; ///< under way
};

namespace services {

/// Errors: refused (a number out of range); nothing was changed then.
inline constexpr ise::request_response<carrier_request, carrier_state> carrier_control{"carrier_control"};
inline constexpr ise::subscription<carrier_state> carrier{"carrier"};

} // namespace services

} // namespace atirma
