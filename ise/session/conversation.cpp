#include <ise/session/conversation.hpp>

#include <ise/core/limits.hpp>

#include <fmt/format.h>

namespace ise {

std::string conversation::caller_name() const {
    if (!over_ || !over_->same_host) return peer_name();
    if (over_->same_process) return "a component without a name in the same process";
    return "a component without a name on the same host";
}

void conversation::send(wire::frame_type type, std::uint8_t flags, std::uint64_t id,
                        function_ref<void(buffer&)> write_body) {
    wire::put_frame(connection_->out().begin_call(), type, flags, id, write_body);
    connection_->out().end_call();
    connection_->written();
}

void conversation::send_ahead(wire::frame_type type, std::uint64_t id, function_ref<void(buffer&)> write_body) {
    wire::put_frame(connection_->out().control(), type, 0, id, write_body);
    connection_->written();
}

result<void> conversation::takes_answers() const {
    auto unsent = connection_->out().pending_call_bytes();
    if (unsent <= 2 * runtime_.options().session_bytes) return {};
    return failure(errc::overloaded,
                   fmt::format("does not take its answers: {} bytes of them wait (session_bytes)", unsent));
}

std::optional<failure> objection_to(const wire::introduction& told) {
    if (told.service.size() > limit::service_name_bytes)
        return failure(errc::too_large,
                       fmt::format("the name of a service has {} bytes, {} are allowed (service_name_bytes)",
                                   told.service.size(), limit::service_name_bytes));
    if (told.fingerprints.size() > limit::service_fingerprints)
        return failure(errc::too_large,
                       fmt::format("'{}' was introduced with {} packets, {} are allowed (service_fingerprints)",
                                   told.service, told.fingerprints.size(), limit::service_fingerprints));
    return std::nullopt;
}

} // namespace ise
