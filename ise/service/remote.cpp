#include <ise/service/remote.hpp>

#include <fmt/format.h>

namespace ise::detail {

pending_call& begin_call(link& to, service_key service, duration deadline, const asio::any_io_executor& caller, asio::cancellation_slot slot) {
    auto& host = to.host();
    auto& call = host.calls().open();
    call.service.assign(service.name);
    call.types = service.types;
    call.deadline = saturating_add(host.on().now(), deadline > duration{} ? deadline : host.options().default_deadline);
    call.trace = {};
    if (const auto* context = context_of(caller)) {
        call.deadline = std::min(call.deadline, context->deadline);
        call.trace = context->trace;
    }
    host.calls().watch(call, slot);
    return call;
}

std::optional<failure> check_place(link& to, service_key service) {
    if (to.host().on().running_here()) return std::nullopt;
    return failure(errc::invalid_argument,
                   fmt::format("'{}' at {} was used off its component's thread: co_spawn on the component's executor, or use ise::wait", service.name, to.name()));
}

} // namespace ise::detail
