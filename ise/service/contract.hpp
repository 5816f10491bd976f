#pragma once
#include <ise/packet/schema.hpp>

#include <cstdint>
#include <string_view>
#include <vector>

namespace ise {

enum class service_kind : std::uint8_t { request_response = 0, subscription = 1 };

std::string_view name_of(service_kind kind) noexcept;

/// The packets of a service, in the order of its kind: request, response; or subscribe request and response,
/// published packet, unsubscribe request and response. Made once a combination of types; compared by address on
/// the hot path.
struct packet_types {
    packet_types(service_kind of_kind, std::vector<schema> of_packets);

    service_kind kind;
    std::vector<schema> schemas;
    std::vector<std::uint64_t> fingerprints;
};

/// Which packet of a service, by its place in `packet_types::schemas`.
namespace role {
inline constexpr std::size_t request = 0;
inline constexpr std::size_t response = 1;
inline constexpr std::size_t subscribe_request = 0;
inline constexpr std::size_t subscribe_response = 1;
inline constexpr std::size_t published = 2;
inline constexpr std::size_t unsubscribe_request = 3;
inline constexpr std::size_t unsubscribe_response = 4;

/// "request", "published packet"…, for messages.
std::string_view name(service_kind kind, std::size_t place) noexcept;
} // namespace role

/// A service as the untyped layers know it.
struct service_key {
    std::string_view name;
    const packet_types* types = nullptr;
};

/// The control packets of a subscription that needs none of its own.
struct nothing {};

/// A service where each request is answered by one response. Declared once, in a header that both sides include:
/// `inline constexpr ise::request_response<set_mode, mode_set> helm{"helm"};`
template <class Request, class Response>
class request_response {
public:
    using request_type = Request;
    using response_type = Response;

    constexpr explicit request_response(std::string_view name) : name_(name) {}
    constexpr std::string_view name() const noexcept { return name_; }

    service_key key() const { return {name_, &types()}; }
    static const packet_types& types() {
        static const packet_types made(service_kind::request_response, {schema_of<Request>(), schema_of<Response>()});
        return made;
    }

    /// `co_await helm(boat, "hold")`: builds the request from its fields and calls with the default deadline.
    template <class Remote, class... Field>
    auto operator()(Remote& provider, Field&&... fields) const {
        return provider.call(*this, Request{std::forward<Field>(fields)...});
    }

private:
    std::string_view name_;
};

/// A service that publishes packets to whoever subscribes, periodically or on events. The control packets can be
/// the user's own: what to subscribe to, what is answered.
template <class Packet, class SubscribeRequest = nothing, class SubscribeResponse = nothing,
          class UnsubscribeRequest = nothing, class UnsubscribeResponse = nothing>
class subscription {
public:
    using packet_type = Packet;
    using subscribe_request = SubscribeRequest;
    using subscribe_response = SubscribeResponse;
    using unsubscribe_request = UnsubscribeRequest;
    using unsubscribe_response = UnsubscribeResponse;

    constexpr explicit subscription(std::string_view name) : name_(name) {}
    constexpr std::string_view name() const noexcept { return name_; }

    service_key key() const { return {name_, &types()}; }
    static const packet_types& types() {
        static const packet_types made(service_kind::subscription,
                                       {schema_of<SubscribeRequest>(), schema_of<SubscribeResponse>(), schema_of<Packet>(),
                                        schema_of<UnsubscribeRequest>(), schema_of<UnsubscribeResponse>()});
        return made;
    }

private:
    std::string_view name_;
};

} // namespace ise
