#pragma once
#include <ise/service/contract.hpp>

#include <cstdint>
#include <string>
#include <vector>

/// What every component tells about itself, whoever asks.
namespace ise {

struct packet_text {
    std::uint64_t fingerprint = 0;
    std::string schema; ///< canonical text
};

struct service_text {
    std::string name;
    std::uint8_t kind = 0; ///< service_kind
    bool provided = true;  ///< else required of others
    std::vector<packet_text> packets; ///< in the order of the kind
};

struct session_text {
    std::string peer;
    std::uint64_t bytes_in = 0;
    std::uint64_t bytes_out = 0;
    std::int64_t round_trip_ns = 0;
};

struct describe_request {};

struct component_text {
    std::string path;
    std::string state;
    std::uint64_t incarnation = 0;
    std::uint64_t epoch = 0;
    std::string host_name;
    std::uint64_t process_id = 0;
    std::vector<std::string> endpoints;
    std::vector<service_text> services;
    std::vector<session_text> sessions;
    std::uint64_t calls_served = 0;
    std::uint64_t packets_published = 0;
    std::uint64_t packets_dropped = 0;
};

inline constexpr request_response<describe_request, component_text> describe_service{"ise.describe"};

} // namespace ise
