#pragma once
#include <ise/core/time.hpp>
#include <ise/service/caution.hpp>
#include <ise/session/contract.hpp>

#include <cstdint>
#include <string>
#include <vector>

/// How a component is, in figures that cost little to ask for: what looks after a running system does so.
namespace ise {

class service_host;

/// Asks for all.
struct health_request {};

/// How many took less than this, and not less than that of the one before.
struct duration_count {
    std::uint64_t below_ns = 0; ///< the end of a bucket, a quarter of a doubling wide (service_meter.hpp)
    std::uint64_t count = 0;    ///< since the component began
};

/// Packets that a publication did not send, by the reason.
struct drop_count {
    std::string reason; ///< "replaced", "overrun", "too_many_bytes", "too_large"; "ended": subscribers, not packets
    std::uint64_t count = 0; ///< since it began
};

/// A service that a component provides, at work.
struct service_load {
    /// As it is described.
    std::string name;
    std::uint64_t running = 0;     ///< of request-response: handlers that run now
    std::uint64_t subscribers = 0; ///< of a subscription: now, those included that are away for a while
    std::uint64_t published = 0;   ///< of a subscription: packets since it began
    std::uint64_t waiting = 0;     ///< requests that no handler is free for, or packets that wait to be sent: now
    std::uint64_t calls = 0;       ///< of request-response: begun since the component began
    std::uint64_t overloaded = 0;  ///< of request-response: refused, as too many waited
    std::uint64_t expired = 0;     ///< of request-response: refused, as their deadline came before a handler was free
    std::vector<duration_count> waited;  ///< of request-response: for a handler, every call; empty buckets are left out
    std::vector<duration_count> handled; ///< of request-response: by a handler, of a sample of the calls
    std::vector<drop_count> drops;       ///< of a subscription: reasons that occurred
};

/// What waits to be sent over a session, published packets apart.
struct session_load {
    std::string peer;               ///< as in `session_info`
    std::uint64_t unsent_bytes = 0; ///< of calls, replies and control
};

/// How the component is now. Fields are only ever appended.
struct health_report {
    wall_time wall{};                   ///< the clock of its host
    std::uint64_t incarnation = 0;      ///< of this life
    std::uint64_t calls_served = 0;     ///< since it began
    std::uint64_t calls_refused = 0;    ///< since it began: expired, unknown, mismatched or beyond a limit
    std::uint64_t packets_dropped = 0;  ///< since it began, by the policies of slow subscribers
    std::vector<service_load> services; ///< provided
    std::vector<session_load> sessions; ///< now
    std::uint64_t calls_expired = 0;    ///< of those refused: their deadline came before a handler was free
    std::uint64_t calls_overloaded = 0; ///< of those refused: beyond a limit
    std::vector<caution> cautions;      ///< about how it was set up
};

/// Every component provides it.
inline constexpr request_response<health_request, health_report> health_service{"ise.health"};

/// Of a component's services; on its loop.
health_report health_of(service_host& services);

} // namespace ise
