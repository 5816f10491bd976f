#pragma once
#include <ise/packet/codec.hpp>
#include <ise/service/call_completion.hpp>
#include <ise/service/contract.hpp>
#include <ise/service/stream_of.hpp>

#include <asio/associated_cancellation_slot.hpp>
#include <asio/associated_executor.hpp>
#include <asio/use_awaitable.hpp>

#include <exception>
#include <memory>
#include <optional>
#include <string>

namespace ise {

class link;

namespace detail {

/// Everything of a call that needs no types: opens the record, which keeps `to`, fits deadline and trace to the context that
/// the executor of whoever waits carries, and sends. Off the component's thread nothing is touched and nothing sent: the
/// call fails, on that executor or, where there is none, on the system's.
void start_call(const std::shared_ptr<link>& to, service_key service, duration deadline, const asio::any_io_executor& waiting, asio::cancellation_slot slot,
                call_completion done, outgoing_packet request);
void start_call(std::shared_ptr<link>&& to, service_key service, duration deadline, const asio::any_io_executor& waiting, asio::cancellation_slot slot,
                call_completion done, outgoing_packet request);
/// A failure where `to` is used on another thread than its component's.
std::optional<failure> check_place(link& to, service_key service);

template <class Response>
result<Response> response_of(const call_outcome& outcome) {
    if (outcome.why) return *outcome.why;
    try {
        result<Response> got{Response{}};
        outcome.response->take_into(*got);
        return got;
    } catch (const error& unfit) { // the provider answered, and so it ran
        return failure(unfit.code(), unfit.what(), execution::unknown);
    }
}

} // namespace detail

/// Another component, as this one sees it: its services can be called and subscribed to. A value, cheap to copy;
/// it names a path (or an address) and finds its holder again whenever that is needed. Used on the loop of the
/// component that made it.
class remote {
public:
    remote() = default;
    /// Made by `component::find`, `at` and `caller`.
    explicit remote(std::shared_ptr<link> to) : link_(std::move(to)) {}

    /// Whether it names anybody; a default-constructed one must not be used.
    explicit operator bool() const noexcept { return link_ != nullptr; }
    /// Its path, or its address.
    const std::string& name() const noexcept;
    /// The path of the component that it talks to now: of a role, the member. Empty while there is no session.
    std::string holder() const;
    link& way() const noexcept { return *link_; } ///< for the layers below

    /// Calls and waits for the response, at most `deadline`. Throws ise::error: refused, no_such_service, type_mismatch,
    /// timed_out, peer_lost, cancelled, overloaded, handler_failed…; `executed()` says whether it may have run.
    /// Cancellation: terminal; the provider's handler is cancelled too.
    /// With g++ 12 `request` is a named variable, never a temporary in braces (it would be freed twice inside `co_await`);
    /// `service.within(deadline, remote, fields…)` builds it safely.
    template <class Contract>
    task<typename Contract::response_type> call(const Contract& service, typename Contract::request_type request, duration deadline = duration()) const {
        using response = typename Contract::response_type;
        return asio::async_initiate<const asio::use_awaitable_t<>, void(std::exception_ptr, response)>(
            [](auto handler, auto&& to, service_key key, typename Contract::request_type packet, duration limit) {
                start<response>(std::move(handler), std::forward<decltype(to)>(to), key, packet, limit, [](auto& waiting, result<response>& got) {
                    if (got) {
                        waiting(std::exception_ptr(), std::move(*got));
                    } else {
                        waiting(std::make_exception_ptr(error(got.error())), response{});
                    }
                });
            },
            asio::use_awaitable, link_, service.key(), std::move(request), deadline);
    }

    /// The same, with the outcome as a value.
    template <class Contract>
    task<result<typename Contract::response_type>> try_call(const Contract& service, typename Contract::request_type request, duration deadline = duration()) const {
        return try_call(service, std::move(request), deadline, asio::use_awaitable);
    }

    /// The same with any completion token of signature `void(ise::result<Response>)`, such as a callback, which
    /// runs on the component's loop.
    template <class Contract, class Token>
    auto try_call(const Contract& service, typename Contract::request_type request, duration deadline, Token&& token) const {
        using response = typename Contract::response_type;
        return asio::async_initiate<Token, void(result<response>)>(
            [](auto handler, auto&& to, service_key key, typename Contract::request_type packet, duration limit) {
                start<response>(std::move(handler), std::forward<decltype(to)>(to), key, packet, limit,
                                [](auto& waiting, result<response>& got) { waiting(std::move(got)); });
            },
            token, link_, service.key(), std::move(request), deadline);
    }

    /// Subscribes; completes when the provider has committed: nothing that it publishes from then on is missed
    /// unless it is counted. Throws ise::error: refused, no_such_service, type_mismatch, timed_out, cancelled.
    template <class Contract>
    task<stream_of<Contract>> subscribe(const Contract& service, subscribe_options options = subscribe_options()) const {
        return begin<Contract>(link_, std::string(service.name()), options, bytes());
    }
    /// With the user's own subscribe packet.
    template <class Contract>
    task<stream_of<Contract>> subscribe(const Contract& service, const typename Contract::subscribe_request& request, subscribe_options options) const {
        return begin<Contract>(link_, std::string(service.name()), options, encode(request));
    }

    /// Waits until there is a session; for programs that want to know before they call.
    task<result<void>> connect(duration deadline) const;

private:
    template <class Response, class Handler, class Link, class Request, class Deliver>
    static void start(Handler handler, Link&& to, service_key key, Request& packet, duration limit, Deliver deliver) {
        asio::any_io_executor waiting = asio::get_associated_executor(handler, asio::any_io_executor());
        auto slot = asio::get_associated_cancellation_slot(handler);
        call_completion done = [handler = std::move(handler), deliver](const call_outcome& outcome) mutable {
            return [handler = std::move(handler), deliver, got = detail::response_of<Response>(outcome)]() mutable { deliver(handler, got); };
        };
        detail::start_call(std::forward<Link>(to), key, limit, waiting, slot, std::move(done), outgoing_packet(packet));
    }

    template <class Contract>
    static task<stream_of<Contract>> begin(std::shared_ptr<link> to, std::string service, subscribe_options options, bytes request) {
        if (auto misplaced = detail::check_place(*to, {service, nullptr})) throw error(std::move(*misplaced));
        if (request.empty()) request = encode(typename Contract::subscribe_request{});
        auto core = std::make_shared<typename stream_of<Contract>::core>(std::move(to), std::move(service), Contract::types(), options, std::move(request));
        stream_of<Contract> made(core); // leaves again if the wait is cancelled
        auto begun = co_await core->begin();
        begun.value();
        co_return made;
    }

    std::shared_ptr<link> link_;
};

} // namespace ise
