#pragma once
#include <ise/core/time.hpp>
#include <ise/session/contract.hpp>

#include <cstdint>
#include <map>
#include <string>
#include <vector>

/// The introspection service of every component.
namespace ise {

/// The description of a packet.
struct packet_info {
    std::uint64_t fingerprint = 0; ///< of the schema
    std::string schema;            ///< canonical text
};

/// A service that a component provides or requires.
struct service_info {
    /// Unique within the component and its direction.
    std::string name;
    std::uint8_t kind = 0;            ///< service_kind
    bool provided = true;             ///< else required
    std::vector<packet_info> packets; ///< in the order of the kind
    bool declared = true;             ///< false: called or subscribed to without `require`
};

/// A present session of a component.
struct session_info {
    std::string peer;               ///< its path, or its address
    std::uint64_t bytes_in = 0;     ///< since it began
    std::uint64_t bytes_out = 0;    ///< since it began
    std::int64_t round_trip_ns = 0; ///< of the last heartbeat
    bool peer_stalled = false;      ///< the peer is busy, and its node answers for it
    std::vector<std::string> uses;  ///< services of the peer that the component has called over it, or is subscribed to
    std::string who;                ///< the peer's verified identity; empty: unknown
};

/// A subscription of the component that ended other than on its request, and was not made again since.
struct ended_subscription_info {
    std::string service;  ///< its name
    std::string provider; ///< its path, or its address
    std::string cause;    ///< why it ended
};

/// Something that the component waits for.
struct wait_info {
    std::string target;  ///< the path, role or address to be reached
    std::string service; ///< its service; empty: only the name, or a session
    std::string stage;   ///< "name": not found; "provider": no session; "unreached": the last call reached no provider
    wall_time since{};   ///< by the clock of its host
    duration waited{};   ///< since then
    std::string cause;   ///< the last obstacle
};

/// A call that a handler of the component waits for.
struct awaited_call_info {
    std::string provider;        ///< its path, role or address
    std::string service;         ///< that is called
    std::uint64_t id = 0;        ///< of the call, in the session with its provider
    std::string handler;         ///< the service whose handler waits
    std::string caller;          ///< of that handler's call: its path, or its address
    std::uint64_t caller_id = 0; ///< the same: of the call, in the session with its caller
    std::string where;           ///< the handler's `co_await`, "boat.cpp:41"; empty: unknown
    duration waited{};           ///< since the call was made
};

/// A request that the component has not answered yet.
struct served_call_info {
    std::string service;  ///< that is called
    std::string caller;   ///< its path, or its address
    std::uint64_t id = 0; ///< of the call, in the session with its caller
    bool running = false; ///< a handler has begun; else the request waits for one
};

/// The request; it has no fields.
struct describe_request {};

/// The description of a component.
struct component_info {
    /// Empty for an anonymous one.
    std::string path;
    std::string state;                                        ///< a component_state by name
    std::uint64_t incarnation = 0;                            ///< of this life
    std::uint64_t epoch = 0;                                  ///< of its name; 0: none granted
    std::string host_name;                                    ///< for people
    std::uint64_t process_id = 0;                             ///< on that host
    std::vector<std::string> endpoints;                       ///< where it listens
    std::vector<service_info> services;                       ///< provided and required
    std::vector<session_info> sessions;                       ///< now
    std::uint64_t calls_served = 0;                           ///< since it began
    std::uint64_t packets_published = 0;                      ///< since it began
    std::uint64_t packets_dropped = 0;                        ///< by the policies of slow subscribers
    bool confirmed = false;                                   ///< its lease is valid, by its own knowledge
    std::map<std::string, std::int32_t> roles;                ///< that it serves, with its priority
    std::vector<ended_subscription_info> ended_subscriptions; ///< the last ones
    std::vector<wait_info> waits;                             ///< present waits of any length
    std::vector<awaited_call_info> awaited; ///< calls that handlers wait for: the first `limit::described_calls`
    std::vector<served_call_info> served;   ///< requests that are not answered yet: as many
    std::string user; ///< of the operating system, as which its process runs; empty in a virtual world
};

/// Every component provides it.
inline constexpr request_response<describe_request, component_info> describe_service{"ise.describe"};

} // namespace ise
