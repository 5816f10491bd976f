#pragma once
#include <ise/component/component.hpp>
#include <ise/service/dynamic_provider.hpp>

#include <memory>
#include <utility>

/// Services whose packets are known at run time only, provided by a component: for programs that replay, bridge or
/// stand in for others. Contracts come from a component (`discover`), from texts (`dynamic_contract::parse`) or from a
/// constant (`dynamic_contract::of`). `component::withdraw(contract)` ends such a service.
namespace ise {

/// Answers the requests of a service by `handler`, as `component::provide` does: `ise::task<dynamic_packet>` or
/// `dynamic_packet` (or `ise::result` of it) of a `dynamic_packet`, with an optional second parameter `const
/// ise::call_context&`. Requests have the schema of the contract, whatever version the caller has; a response of
/// another schema is adapted. Throws errc::invalid_argument for a subscription, or if the component already has a
/// service of that name; errc::overloaded beyond `kept_services`.
template <class Handler>
void provide_dynamic(component& by, const dynamic_contract& service, Handler handler,
                     serve_options options = serve_options()) {
    using parts = detail::component_parts;
    parts::add(by,
               detail::make_any_dynamic_service(parts::runtime(by), service, std::move(handler), std::move(options)));
}

/// Provides a subscription service: call the result with a packet to publish it. Errors as above.
inline dynamic_publication publish_dynamic(component& by, const dynamic_contract& service,
                                           dynamic_callbacks callbacks = dynamic_callbacks()) {
    using parts = detail::component_parts;
    auto core = make_dynamic_publication(parts::runtime(by), service, std::move(callbacks));
    parts::add(by, core);
    return {std::move(core), service.packet(role::published)};
}

} // namespace ise
