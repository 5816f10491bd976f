#pragma once
#include <ise/core/time.hpp>
#include <ise/service/contract.hpp>

#include <cstdint>
#include <string>
#include <vector>

/// How a component is, in figures that cost little to ask for: what looks after a running system does so.
namespace ise {

class service_host;

/// Asks for all.
struct health_request {};

/// A service that a component provides, at work.
struct service_load {
    /// As it is described.
    std::string name;
    std::uint64_t running = 0;     ///< of request-response: handlers that run now
    std::uint64_t subscribers = 0; ///< of a subscription: now, those included that are away for a while
    std::uint64_t published = 0;   ///< of a subscription: packets since it began
};

/// What waits to be sent over a session, published packets apart.
struct session_load {
    std::string peer; ///< as in `session_text`
    std::uint64_t unsent_bytes = 0; ///< of calls, replies and control
};

/// How the component is now. Fields are only ever appended.
struct health_text {
    wall_time wall{};                ///< the clock of its host
    std::uint64_t incarnation = 0;   ///< of this life
    std::uint64_t calls_served = 0;  ///< since it began
    std::uint64_t calls_refused = 0; ///< since it began: expired, unknown, mismatched or beyond a limit
    std::uint64_t packets_dropped = 0; ///< since it began, by the policies of slow subscribers
    std::vector<service_load> services; ///< provided
    std::vector<session_load> sessions; ///< now
};

/// Every component provides it.
inline constexpr request_response<health_request, health_text> health_service{"ise.health"};

/// Of a component's services; on its loop.
health_text health_of(service_host& services);

} // namespace ise
