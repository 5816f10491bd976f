#pragma once
#include <ise/core/time.hpp>
#include <ise/packet/schema.hpp>

#include <cstdint>
#include <string_view>
#include <vector>

namespace ise {

/// The two kinds of services; the numbers are part of the wire format.
enum class service_kind : std::uint8_t { request_response = 0, subscription = 1 };

/// "request_response", "subscription".
std::string_view name_of(service_kind kind) noexcept;

/// The packets of a service, in the order of its kind: request, response; or subscribe request and response,
/// published packet, unsubscribe request and response. Made once for each combination of types; compared by address on
/// the hot path.
struct packet_types {
    /// Computes the fingerprints.
    packet_types(service_kind of_kind, std::vector<schema> of_packets);

    service_kind kind;                       ///< of the service
    std::vector<schema> schemas;             ///< of its packets
    std::vector<std::uint64_t> fingerprints; ///< of these, in their order
};

/// Which packet of a service, by its place in `packet_types::schemas`.
namespace role {
inline constexpr std::size_t request = 0;              ///< of a request-response service
inline constexpr std::size_t response = 1;             ///< of a request-response service
inline constexpr std::size_t subscribe_request = 0;    ///< of a subscription
inline constexpr std::size_t subscribe_response = 1;   ///< of a subscription
inline constexpr std::size_t published = 2;            ///< of a subscription
inline constexpr std::size_t unsubscribe_request = 3;  ///< of a subscription
inline constexpr std::size_t unsubscribe_response = 4; ///< of a subscription

/// "request", "published packet"…, for messages.
std::string_view name(service_kind kind, std::size_t place) noexcept;
} // namespace role

/// A service as the untyped layers know it.
struct service_key {
    /// Unique among the services of a component.
    std::string_view name;
    const packet_types* types = nullptr; ///< live as long as the program, or as the contract
};

/// The default control packet of a subscription.
struct nothing {};

/// A service where each request is answered by one response. Declared once, in a header that both sides include:
/// `inline constexpr ise::request_response<set_mode, mode_set> helm{"helm"};`
template <class Request, class Response>
class request_response {
public:
    /// The request packet.
    using request_type = Request;
    /// The response packet.
    using response_type = Response;

    /// `name` must be a string literal; it is not copied.
    constexpr explicit request_response(std::string_view name) : name_(name) {}
    /// The name of the service, unique within its component.
    constexpr std::string_view name() const noexcept { return name_; }

    /// The service without its types.
    service_key key() const { return {name_, &types()}; }
    /// The schemas of its packets, made once.
    static const packet_types& types() {
        static const packet_types made = describe();
        return made;
    }

private:
    static packet_types describe() {
        return packet_types(service_kind::request_response, {schema_of<Request>(), schema_of<Response>()});
    }

    std::string_view name_;
};

/// A service that publishes packets to its subscribers, periodically or on events. The control packets can be
/// the user's own, for example a filter in the subscribe request.
template <class Packet, class SubscribeRequest = nothing, class SubscribeResponse = nothing,
          class UnsubscribeRequest = nothing, class UnsubscribeResponse = nothing>
class subscription {
public:
    /// The published packet.
    using packet_type = Packet;
    /// The subscribe request.
    using subscribe_request = SubscribeRequest;
    /// The response to it.
    using subscribe_response = SubscribeResponse;
    /// The unsubscribe request.
    using unsubscribe_request = UnsubscribeRequest;
    /// The response to the unsubscribe request.
    using unsubscribe_response = UnsubscribeResponse;

    /// `name` must be a string literal; it is not copied.
    constexpr explicit subscription(std::string_view name) : name_(name) {}
    /// The name of the service, unique within its component.
    constexpr std::string_view name() const noexcept { return name_; }

    /// The service without its types.
    service_key key() const { return {name_, &types()}; }
    /// The schemas of its packets, made once.
    static const packet_types& types() {
        static const packet_types made = describe();
        return made;
    }

private:
    static packet_types describe() {
        return packet_types(service_kind::subscription,
                            {schema_of<SubscribeRequest>(), schema_of<SubscribeResponse>(), schema_of<Packet>(),
                             schema_of<UnsubscribeRequest>(), schema_of<UnsubscribeResponse>()});
    }

    std::string_view name_;
};

} // namespace ise
