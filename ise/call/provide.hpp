#pragma once
#include <ise/call/call_service.hpp>
#include <ise/packet/codec.hpp>

#include <concepts>
#include <functional>
#include <memory>
#include <optional>

namespace ise {

namespace detail {

/// The failure that the caller gets for a handler's exception.
failure failure_of(const std::exception_ptr& thrown);

/// A handler that is a coroutine: `task<Response>(Request)` or `task<Response>(Request, const call_context&)`.
template <class Request, class Response, class Handler>
class coroutine_service final : public call_service {
public:
    coroutine_service(service_runtime& runtime, std::string name, const packet_types& types, serve_options options,
                      Handler handler)
        : call_service(runtime, std::move(name), types, options), handler_(std::move(handler)) {}

private:
    class worker final : public call_worker {
    public:
        worker(coroutine_service& of, service_runtime& runtime) : call_worker(of, runtime), service_(of) {}

    private:
        void load(incoming_packet& request) override { request.take_into(request_.emplace()); }

        task<> run() override {
            for (;;) {
                bool more = co_await next();
                if (!more) co_return;
                std::optional<failure> problem;
                if (may_begin()) {
                    try {
                        auto handling = start();
                        auto response = co_await std::move(handling);
                        answer(outgoing_packet(response));
                    } catch (...) {
                        problem = failure_of(std::current_exception());
                    }
                }
                if (problem) answer(*problem);
                // A cancelled call leaves its mark on the coroutine; the next call must not see it.
                co_await this_task::forget_cancellation;
            }
        }

        task<Response> start() {
            if constexpr (std::is_invocable_v<Handler&, Request, const call_context&>) {
                return service_.handler_(std::move(*request_), context());
            } else {
                return service_.handler_(std::move(*request_));
            }
        }

        coroutine_service& service_;
        std::optional<Request> request_;
    };

    std::unique_ptr<call_worker> make_worker() override { return std::make_unique<worker>(*this, runtime()); }

    Handler handler_;
};

/// A handler that is a plain function: `Response(Request)`. Answered at once, without a coroutine.
template <class Request, class Response, class Handler>
class plain_service final : public call_service {
public:
    plain_service(service_runtime& runtime, std::string name, const packet_types& types, Handler handler)
        : call_service(runtime, std::move(name), types), handler_(std::move(handler)) {}

private:
    void serve_now(call_origin& from, const incoming_call& call, incoming_packet& came) override {
        Request request{};
        came.take_into(request);
        auto response = answer(from, call, std::move(request));
        if (response) {
            from.reply(call.id, outgoing_packet(*response));
        } else {
            tell_failure(from, response.error());
            from.refuse(call.id, response.error());
        }
    }

    result<Response> answer(const call_origin& from, const incoming_call& call, Request request) {
        try {
            if constexpr (std::is_invocable_v<Handler&, Request, const call_context&>) {
                call_context context;
                describe(context, from, call);
                return handler_(std::move(request), context);
            } else {
                return handler_(std::move(request));
            }
        } catch (...) {
            return failure_of(std::current_exception());
        }
    }

    Handler handler_;
};

template <class Handler, class Request>
struct handler_result {
    using type = std::invoke_result_t<Handler&, Request>;
};
template <class Handler, class Request>
requires std::is_invocable_v<Handler&, Request, const call_context&>
struct handler_result<Handler, Request> {
    using type = std::invoke_result_t<Handler&, Request, const call_context&>;
};

} // namespace detail

/// Makes the service that answers requests by `handler`: a coroutine `ise::task<Response>(Request)` or a plain
/// function `Response(Request)` (or `ise::result<Response>(Request)`), either also with a second parameter
/// `const ise::call_context&`. The caller receives its exceptions as errors with their text: an ise::error with
/// errc::refused or errc::access_denied unchanged, all others as errc::handler_failed. A returned failure keeps its
/// code.
template <class Contract, class Handler>
std::shared_ptr<call_service> make_call_service(service_runtime& runtime, const Contract& contract, Handler handler,
                                                serve_options options = serve_options()) {
    using request = typename Contract::request_type;
    using response = typename Contract::response_type;
    static_assert(std::is_invocable_v<Handler&, request> || std::is_invocable_v<Handler&, request, const call_context&>,
                  "ise: a handler takes the service's request packet, and perhaps a const ise::call_context&");
    using answer = typename detail::handler_result<Handler, request>::type;
    auto name = std::string(contract.name());
    if constexpr (std::is_same_v<answer, task<response>>) {
        return std::make_shared<detail::coroutine_service<request, response, Handler>>(
            runtime, std::move(name), Contract::types(), options, std::move(handler));
    } else {
        static_assert(std::is_convertible_v<answer, result<response>>,
                      "ise: a handler returns the service's response packet, or an ise::task or ise::result of it");
        return std::make_shared<detail::plain_service<request, response, Handler>>(
            runtime, std::move(name), Contract::types(), std::move(handler));
    }
}

} // namespace ise
