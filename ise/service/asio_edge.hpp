#pragma once
#include <ise/core/asio_configuration.hpp>
#include <ise/core/frame_pool.hpp>
#include <ise/core/loop.hpp>
#include <ise/service/remote.hpp>

#include <asio/any_io_executor.hpp>
#include <asio/associated_cancellation_slot.hpp>
#include <asio/associated_executor.hpp>
#include <asio/async_result.hpp>
#include <asio/cancellation_type.hpp>
#include <asio/post.hpp>
#include <asio/system_executor.hpp>

#include <memory>
#include <optional>
#include <utility>

namespace ise::detail {

struct slot_cancellation;

/// A call that can be given up through the slot of a completion handler.
struct cancellable_call : call_waiter {
    slot_cancellation* slot = nullptr;

protected:
    ~cancellable_call();
};

/// The handler in that slot; it may outlive the call.
struct slot_cancellation {
    explicit slot_cancellation(cancellable_call& of) noexcept : call(&of) { of.slot = this; }
    slot_cancellation(const slot_cancellation&) = delete;
    slot_cancellation& operator=(const slot_cancellation&) = delete;
    ~slot_cancellation() {
        if (call) call->slot = nullptr;
    }
    void operator()(asio::cancellation_type kind) {
        if (call && kind != asio::cancellation_type::none) call->give_up();
    }
    cancellable_call* call;
};

inline cancellable_call::~cancellable_call() {
    if (slot) slot->call = nullptr;
}

/// A call for a completion handler. Owns itself while it is under way.
template <class Response, class Handler>
class handled_call final : public cancellable_call {
public:
    handled_call(peer_channel& to, Handler handler) : owner_(keep(to)), handler_(std::move(handler)) {}

    static void* operator new(std::size_t size) { return frame_pool::allocate(size); }
    static void operator delete(void* at, std::size_t size) noexcept { frame_pool::release(at, size); }

    void end(loop& on, const call_outcome& outcome) override {
        take_outcome(outcome, got_);
        on.later([self = std::unique_ptr<handled_call>(this)]() mutable { complete(std::move(self)); });
    }
    void drop() noexcept override { delete this; }

private:
    // Its memory is free for a call that the handler makes.
    static void complete(std::unique_ptr<handled_call> self) {
        auto handler = std::move(self->handler_);
        auto got = std::move(*self->got_);
        self.reset();
        handler(std::move(got));
    }

    held<call_owner> owner_;
    Handler handler_;
    std::optional<result<Response>> got_;
};

template <class Token>
struct asio_edge {
    /// A call that completes `token` (`remote::try_call`).
    template <class Contract>
    static auto call(const std::shared_ptr<peer_channel>& to, const Contract& service,
                     typename Contract::request_type request, duration deadline, Token token) {
        using response_type = typename Contract::response_type;
        return asio::async_initiate<Token, void(result<response_type>)>(
            [](auto handler, const std::shared_ptr<peer_channel>& callee, service_key key,
               typename Contract::request_type packet,
               duration limit) { start<response_type>(std::move(handler), *callee, key, packet, limit); },
            token, to, service.key(), std::move(request), deadline);
    }

private:
    template <class Response, class Handler, class Request>
    static void start(Handler handler, peer_channel& to, service_key key, Request& packet, duration limit) {
        asio::any_io_executor waiting = asio::get_associated_executor(handler, asio::any_io_executor());
        if (!is_here(to)) {
            if (!waiting) waiting = asio::system_executor();
            asio::post(waiting, [handler = std::move(handler), why = misplaced(to, key)]() mutable {
                auto taken = std::move(handler);
                taken(result<Response>(std::move(why)));
            });
            return;
        }
        auto slot = asio::get_associated_cancellation_slot(handler);
        auto* call = new handled_call<Response, Handler>(to, std::move(handler));
        if (slot.is_connected()) slot.template emplace<slot_cancellation>(*call);
        start_call(to, key, limit, waiting, *call, outgoing_packet(packet));
    }
};

} // namespace ise::detail
