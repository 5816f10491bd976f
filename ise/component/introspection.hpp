#pragma once
#include <ise/service/contract.hpp>

#include <cstdint>
#include <map>
#include <string>
#include <vector>

/// What every component tells about itself, whoever asks.
namespace ise {

/// A packet as it is described.
struct packet_text {
    std::uint64_t fingerprint = 0; ///< of the schema
    std::string schema;            ///< canonical text
};

/// A service that a component provides or needs.
struct service_text {
    /// Unique within the component and its direction.
    std::string name;
    std::uint8_t kind = 0;            ///< service_kind
    bool provided = true;             ///< else required of others
    std::vector<packet_text> packets; ///< in the order of the kind
};

/// A session of a component, now.
struct session_text {
    std::string peer;               ///< its path, or its address
    std::uint64_t bytes_in = 0;     ///< since it began
    std::uint64_t bytes_out = 0;    ///< since it began
    std::int64_t round_trip_ns = 0; ///< of the last heartbeat
    bool peer_stalled = false;      ///< the peer is busy, and its node answers for it
};

/// A subscription of the component that ended other than by its wish, and was not made again since.
struct ended_subscription_text {
    std::string service;  ///< its name
    std::string provider; ///< its path, or its address
    std::string cause;    ///< why it ended
};

/// Asks for all.
struct describe_request {};

/// What a component tells of itself.
struct component_text {
    /// Empty for an anonymous one.
    std::string path;
    std::string state;                   ///< a component_state by name
    std::uint64_t incarnation = 0;       ///< of this life
    std::uint64_t epoch = 0;             ///< of its name; 0: none granted
    std::string host_name;               ///< for people
    std::uint64_t process_id = 0;        ///< on that host
    std::vector<std::string> endpoints;  ///< where it listens
    std::vector<service_text> services;  ///< provided and required
    std::vector<session_text> sessions;  ///< now
    std::uint64_t calls_served = 0;      ///< since it began
    std::uint64_t packets_published = 0; ///< since it began
    std::uint64_t packets_dropped = 0;   ///< by the policies of slow subscribers
    bool confirmed = false;              ///< its name: the lease holds, as far as it knows
    std::map<std::string, std::int32_t> roles; ///< that it serves, with its priority
    std::vector<ended_subscription_text> ended_subscriptions; ///< the last ones
};

/// Every component provides it.
inline constexpr request_response<describe_request, component_text> describe_service{"ise.describe"};

} // namespace ise
