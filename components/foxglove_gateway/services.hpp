#pragma once
#include <ise/session/contract.hpp>

#include <cstdint>
#include <string>

/// What the gateway provides to ISE.
namespace ise::foxglove {

/// Asks for `gateway_status`.
struct status_request {};
/// How the gateway is.
struct gateway_status {
    std::string url;                 ///< where viewers connect: "ws://127.0.0.1:8765/"
    std::uint32_t viewers = 0;       ///< now
    std::uint64_t accepted = 0;      ///< viewers, since it began
    std::uint64_t refused = 0;       ///< for their origin, a wrong handshake, or as too many were there
    std::uint32_t channels = 0;      ///< advertised now
    std::uint32_t subscriptions = 0; ///< of the gateway to components, now
    std::uint64_t messages = 0;      ///< sent to viewers
    std::uint64_t skipped = 0;       ///< messages that a viewer did not take before newer ones of the channel came
    std::uint64_t malformed = 0;     ///< messages of viewers that were refused
    std::uint64_t calls = 0;         ///< made for viewers
    std::uint64_t calls_failed = 0;  ///< of these
    std::uint64_t published = 0;     ///< messages of viewers that were published
    std::uint64_t disconnected = 0;  ///< viewers that were disconnected as they did not read
};
/// How the gateway is.
inline constexpr request_response<status_request, gateway_status> status_service{"status"};

/// A message that a viewer published on a channel of its own.
struct viewer_message {
    std::string viewer;      ///< its address
    std::string topic;       ///< as the viewer named it
    std::string encoding;    ///< "json" or "protobuf"
    std::string schema_name; ///< as the viewer named it
    std::string data;        ///< as it came
};
/// Messages of viewers, where the gateway may publish (`allow-publish`).
inline constexpr subscription<viewer_message> published_service{"published"};

} // namespace ise::foxglove
