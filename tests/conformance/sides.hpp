#pragma once
#include <ise/core/error.hpp>
#include <ise/core/result.hpp>
#include <ise/packet/dynamic.hpp>
#include <ise/service/dynamic.hpp>
#include <ise/service/dynamic_provider.hpp>
#include <ise/service/remote.hpp>
#include <ise/subscription/publication.hpp>
#include <ise/subscription/received.hpp>

#include <support/party.hpp>

#include <memory>
#include <optional>
#include <type_traits>
#include <utility>

/// A provider and a requester that use their services' headers, or do not: packets are then dynamic values on their way
/// through the library, and only the tests know their types.
namespace conformance {

/// By ISE_CONFORMANCE_DYNAMIC: "provider" or "both"; else neither.
bool dynamic_provider();
bool dynamic_requester();

template <class Packet>
ise::received<Packet> typed(const ise::received<ise::dynamic_packet>& from) {
    if (!from) return {};
    return ise::received<Packet>(ise::counted<Packet>::make(from->template as<Packet>()), from.origin());
}

/// What `side::publish` gives.
template <class Contract>
class publication {
    using packet = typename Contract::packet_type;

public:
    publication() = default;
    explicit publication(ise::publication<Contract> made) : typed_(std::move(made)) {}
    explicit publication(ise::dynamic_publication made) : dynamic_(std::move(made)) {}

    void operator()(const packet& what) const { dynamic_ ? dynamic_(ise::to_dynamic(what)) : typed_(what); }
    ise::task<> send(const packet& what) const {
        return dynamic_ ? dynamic_.send(ise::to_dynamic(what)) : typed_.send(what);
    }
    bool try_send(const packet& what) const {
        return dynamic_ ? dynamic_.try_send(ise::to_dynamic(what)) : typed_.try_send(what);
    }
    std::size_t subscribers() const { return dynamic_ ? dynamic_.subscribers() : typed_.subscribers(); }
    std::uint64_t published() const { return dynamic_ ? dynamic_.published() : typed_.published(); }

private:
    ise::publication<Contract> typed_;
    ise::dynamic_publication dynamic_;
};

/// What `subscribe_to` gives.
template <class Contract>
class subscriber {
    using packet = typename Contract::packet_type;
    using response_type = typename Contract::subscribe_response;
    using farewell = typename Contract::unsubscribe_request;
    using parting = typename Contract::unsubscribe_response;

public:
    subscriber() = default;
    explicit subscriber(ise::subscriber<Contract> made) : typed_(std::move(made)) {}
    explicit subscriber(ise::dynamic_stream made)
        : dynamic_(std::move(made)), response_(dynamic_->response().template as<response_type>()) {}

    ise::task<ise::received<packet>> next() {
        if (!dynamic_) return typed_.next();
        return next_typed(*dynamic_);
    }
    ise::received<packet> try_next() { return dynamic_ ? typed<packet>(dynamic_->try_next()) : typed_.try_next(); }
    const response_type& response() const { return dynamic_ ? response_ : typed_.response(); }
    const ise::subscription_counts& counts() const { return dynamic_ ? dynamic_->counts() : typed_.counts(); }
    bool ended() const { return dynamic_ ? dynamic_->ended() : typed_.ended(); }
    const ise::failure& cause() const { return dynamic_ ? dynamic_->cause() : typed_.cause(); }
    ise::task<parting> unsubscribe(farewell last, ise::duration deadline) {
        if (!dynamic_) return typed_.unsubscribe(std::move(last), deadline);
        return unsubscribe_typed(*dynamic_, ise::to_dynamic(last), deadline);
    }

private:
    static ise::task<ise::received<packet>> next_typed(ise::dynamic_stream& from) {
        auto came = co_await from.next();
        co_return typed<packet>(came);
    }
    static ise::task<parting> unsubscribe_typed(ise::dynamic_stream& from, ise::dynamic_packet last,
                                                ise::duration deadline) {
        auto answer = co_await from.unsubscribe(std::move(last), deadline);
        co_return answer.value().template as<parting>();
    }

    ise::subscriber<Contract> typed_;
    std::optional<ise::dynamic_stream> dynamic_;
    response_type response_{};
};

template <class Contract>
ise::task<subscriber<Contract>> subscribe_to(ise::remote from, Contract service,
                                             typename Contract::subscribe_request request,
                                             ise::subscribe_options options) {
    if (!dynamic_requester()) {
        auto made = co_await from.subscribe(service, request, options);
        co_return subscriber<Contract>(std::move(made));
    }
    auto contract = ise::dynamic_contract::of(service);
    auto asked = ise::to_dynamic(request);
    auto made = co_await ise::subscribe_dynamic(from, std::move(contract), std::move(asked), options);
    co_return subscriber<Contract>(std::move(made.value()));
}
template <class Contract>
ise::task<subscriber<Contract>> subscribe_to(ise::remote from, Contract service, ise::subscribe_options options) {
    return subscribe_to(std::move(from), service, typename Contract::subscribe_request(), options);
}

template <class Contract>
ise::task<ise::result<typename Contract::response_type>> try_call(ise::remote to, Contract service,
                                                                  typename Contract::request_type request,
                                                                  ise::duration limit) {
    if (!dynamic_requester()) {
        auto got = co_await to.try_call(service, std::move(request), limit);
        co_return got;
    }
    auto contract = ise::dynamic_contract::of(service);
    auto asked = ise::to_dynamic(request);
    auto got = co_await ise::call_dynamic(to, std::move(contract), std::move(asked), limit);
    if (!got) co_return got.error();
    co_return got->template as<typename Contract::response_type>();
}

/// A party that provides as it is told to.
struct side : ise_test::party {
    using party::party;

    template <class Contract, class Handler>
    void provide(const Contract& contract, Handler handler, ise::serve_options options = ise::serve_options()) {
        if (!dynamic_provider()) return party::provide(contract, std::move(handler), options);
        using request = typename Contract::request_type;
        using response = typename Contract::response_type;
        auto service = ise::dynamic_contract::of(contract);
        if constexpr (std::is_same_v<std::invoke_result_t<Handler&, request>, ise::task<response>>) {
            auto held = std::make_shared<Handler>(std::move(handler));
            add(service, options, [held](ise::dynamic_packet asked) -> ise::task<ise::dynamic_packet> {
                auto handling = (*held)(asked.as<request>());
                auto made = co_await std::move(handling);
                co_return ise::to_dynamic(made);
            });
        } else {
            add(service, options, [handler](ise::dynamic_packet asked) mutable {
                return ise::to_dynamic(response(handler(asked.as<request>())));
            });
        }
    }

    template <class Contract>
    publication<Contract> publish(const Contract& contract, ise::publication_callbacks<Contract> callbacks = {}) {
        if (!dynamic_provider()) return publication<Contract>(party::publish(contract, std::move(callbacks)));
        using subscribing = typename Contract::subscribe_request;
        using parting = typename Contract::unsubscribe_request;
        auto service = ise::dynamic_contract::of(contract);
        ise::dynamic_callbacks made;
        if (callbacks.on_subscribe)
            made.on_subscribe = [decide = std::move(callbacks.on_subscribe)](
                                    const ise::dynamic_packet& asked,
                                    const ise::subscriber_info& who) -> ise::result<ise::dynamic_packet> {
                auto response = decide(asked.as<subscribing>(), who);
                if (!response) return response.error();
                return ise::to_dynamic(*response);
            };
        if (callbacks.on_unsubscribe)
            made.on_unsubscribe = [tell = std::move(callbacks.on_unsubscribe)](const ise::dynamic_packet& last,
                                                                               const ise::subscriber_info& who) {
                return ise::to_dynamic(tell(last.as<parting>(), who));
            };
        auto core = ise::make_dynamic_publication(*services, service, std::move(made));
        services->services().add(core).value();
        ise::dynamic_publication out(core, service.packet(ise::role::published));
        return publication<Contract>(std::move(out));
    }

private:
    template <class Handler>
    void add(const ise::dynamic_contract& service, ise::serve_options options, Handler handler) {
        services->services()
            .add(ise::detail::make_any_dynamic_service(*services, service, std::move(handler), options))
            .value();
    }
};

} // namespace conformance
