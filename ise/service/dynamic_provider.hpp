#pragma once
#include <ise/call/call_service.hpp>
#include <ise/call/context.hpp>
#include <ise/core/result.hpp>
#include <ise/core/task.hpp>
#include <ise/packet/dynamic.hpp>
#include <ise/service/dynamic.hpp>
#include <ise/subscription/publication_core.hpp>

#include <cstdint>
#include <functional>
#include <memory>
#include <type_traits>

/// Provided services whose packets are known at run time only. `provide_dynamic` and `publish_dynamic` of
/// <ise/component/provide_dynamic.hpp> add them to a component.
namespace ise {

class service_runtime;

/// A handler that is a coroutine. The context lives as long as the handler runs.
using dynamic_handler = std::function<task<dynamic_packet>(dynamic_packet request, const call_context& context)>;
/// A handler that is a plain function; a failure that it returns keeps its code.
using dynamic_function = std::function<result<dynamic_packet>(dynamic_packet request, const call_context& context)>;

/// A request-response service that answers by `handler`. Requests have the service's own schema; responses of
/// another schema are adapted, and a response that does not fit fails the call (errc::handler_failed). Exceptions are
/// those of `make_call_service`. Throws errc::invalid_argument for a subscription, errc::overloaded beyond
/// `kept_services`.
std::shared_ptr<call_service> make_dynamic_service(service_runtime& runtime, const dynamic_contract& service,
                                                   dynamic_handler handler, serve_options options = serve_options());
/// The same with a plain function, which is answered at once.
std::shared_ptr<call_service> make_dynamic_service(service_runtime& runtime, const dynamic_contract& service,
                                                   dynamic_function handler);

namespace detail {

// Takes the context or leaves it, as the handlers of `component::provide` do.
template <class Handler>
decltype(auto) call_dynamic_handler(Handler& handler, dynamic_packet&& request, const call_context& context) {
    if constexpr (std::is_invocable_v<Handler&, dynamic_packet, const call_context&>) {
        return handler(std::move(request), context);
    } else {
        return handler(std::move(request));
    }
}

template <class Handler>
std::shared_ptr<call_service> make_any_dynamic_service(service_runtime& runtime, const dynamic_contract& service,
                                                       Handler handler, serve_options options) {
    static_assert(std::is_invocable_v<Handler&, dynamic_packet> ||
                      std::is_invocable_v<Handler&, dynamic_packet, const call_context&>,
                  "ise: a dynamic handler takes an ise::dynamic_packet, and perhaps a const ise::call_context&");
    auto shared = std::make_shared<Handler>(std::move(handler)); // std::function wants what can be copied
    using answer =
        decltype(call_dynamic_handler(*shared, std::declval<dynamic_packet>(), std::declval<const call_context&>()));
    if constexpr (std::is_same_v<answer, task<dynamic_packet>>) {
        dynamic_handler made = [shared](dynamic_packet request, const call_context& context) {
            return call_dynamic_handler(*shared, std::move(request), context);
        };
        return make_dynamic_service(runtime, service, std::move(made), options);
    } else {
        static_assert(std::is_convertible_v<answer, result<dynamic_packet>>,
                      "ise: a dynamic handler returns an ise::dynamic_packet, or an ise::task or ise::result of it");
        dynamic_function made = [shared](dynamic_packet request, const call_context& context) {
            return result<dynamic_packet>(call_dynamic_handler(*shared, std::move(request), context));
        };
        return make_dynamic_service(runtime, service, std::move(made));
    }
}

} // namespace detail

/// A subscription service whose packets are known at run time only; see `publication`. A value, cheap to copy; used on
/// its component's loop. Functions of an empty one throw errc::invalid_argument.
class dynamic_publication {
public:
    dynamic_publication() = default;
    /// Made by `publish_dynamic`.
    dynamic_publication(std::shared_ptr<publication_core> core, schema packet)
        : core_(std::move(core)), type_(std::move(packet)) {}

    /// Whether it publishes anything; false for an empty one.
    explicit operator bool() const noexcept { return core_ != nullptr; }
    /// The schema of the packets that it publishes.
    const schema& type() const noexcept { return type_; }

    /// Publishes to all subscribers, by their policies; never blocks. A packet of another schema is adapted; throws
    /// errc::type_mismatch with the diff if it cannot be.
    void operator()(const dynamic_packet& packet) const;
    /// Publishes only to subscribers for which `wants(const subscriber_info&)` returns true; see `publication`.
    void publish_if(const dynamic_packet& packet, function_ref<bool(const subscriber_info&)> wants) const;
    /// Waits until every connected lossless subscriber has room, then publishes; see `publication::send`.
    /// Cancellation: terminal, the packet is not published. The packet is encoded before this returns.
    task<> send(const dynamic_packet& packet) const;
    /// Publishes if every lossless subscriber has room; otherwise does nothing and returns false.
    bool try_send(const dynamic_packet& packet) const;
    /// Ends its subscriptions with this reason. With errc::peer_lost `component::listen` subscribes again.
    void end(const failure& why) const;

    /// The number of subscribers, including unreachable ones within their linger.
    std::size_t subscribers() const;
    /// The number of packets published so far, which is the sequence number of the last one.
    std::uint64_t published() const;

private:
    publication_core& core() const;
    published_packet made(const dynamic_packet& packet) const;

    std::shared_ptr<publication_core> core_;
    schema type_;
};

/// The provider's callbacks of such a subscription; each may be empty. Packets of another schema are adapted.
struct dynamic_callbacks {
    /// Accepts a subscriber by returning a response, or refuses it with a failure such as errc::refused.
    std::function<result<dynamic_packet>(const dynamic_packet& request, const subscriber_info&)> on_subscribe;
    /// A subscriber has left (its request) or vanished (a default request).
    std::function<dynamic_packet(const dynamic_packet& request, const subscriber_info&)> on_unsubscribe;
};

/// Implementation of `publish_dynamic`. Throws errc::invalid_argument for a request-response service, errc::overloaded
/// beyond `kept_services`.
std::shared_ptr<publication_core> make_dynamic_publication(service_runtime& runtime, const dynamic_contract& service,
                                                           dynamic_callbacks callbacks = dynamic_callbacks());

} // namespace ise
