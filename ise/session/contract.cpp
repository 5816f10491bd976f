#include <ise/session/contract.hpp>

namespace ise {

std::string_view name_of(service_kind kind) noexcept {
    return kind == service_kind::request_response ? "request-response" : "subscription";
}

packet_types::packet_types(service_kind of_kind, std::vector<schema> of_packets)
    : kind(of_kind), schemas(std::move(of_packets)) {
    for (const auto& packet : schemas) fingerprints.push_back(packet.fingerprint());
}

std::string_view role::name(service_kind kind, std::size_t place) noexcept {
    if (kind == service_kind::request_response) return place == request ? "request" : "response";
    switch (place) {
        case subscribe_request: return "subscribe request";
        case subscribe_response: return "subscribe response";
        case published: return "published packet";
        case unsubscribe_request: return "unsubscribe request";
        default: return "unsubscribe response";
    }
}

} // namespace ise
