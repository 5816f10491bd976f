#pragma once
#include <ise/core/loop.hpp>
#include <ise/core/unique_function.hpp>

#include <asio/associated_cancellation_slot.hpp>
#include <asio/async_result.hpp>
#include <asio/use_awaitable.hpp>

#include <tuple>
#include <utility>

namespace ise {

/// The one place where a coroutine of ISE is suspended: it waits for one completion `(T...)` that somebody on
/// the same loop gives by `resume()`.
///
/// The coroutine goes on at the end of the loop's turn, never inside `resume()`. Cancellation of the waiting
/// coroutine calls `on_cancel`, whose owner answers with `resume()` (or lets it go on waiting); one without does not
/// hear of it. A waiter that waits should be resumed before it is destroyed; what still waits then, or when the loop
/// ends, is destroyed without being resumed.
template <class... T>
class waiter final : public suspended {
public:
    waiter(loop& owner, unique_function<void()> on_cancel) : loop_(owner), on_cancel_(std::move(on_cancel)) {}
    waiter(const waiter&) = delete;
    waiter& operator=(const waiter&) = delete;
    ~waiter() {
        if (!handler_) return;
        loop_.delist(*this);
        drop();
    }

    bool waiting() const noexcept { return static_cast<bool>(handler_); }

    /// Waits; one coroutine at a time. `token` defaults to an awaitable.
    template <class Token = asio::use_awaitable_t<>>
    auto wait(Token&& token = {}) {
        return asio::async_initiate<Token, void(T...)>([this](auto handler) { this->begin(std::move(handler)); },
                                                       token);
    }

    /// Takes a handler of signature `void(T...)` and keeps it until `resume()`.
    template <class Handler>
    void begin(Handler handler) {
        if (loop_.abandoned()) return; // nothing would ever resume it
        if (on_cancel_) slot_ = asio::get_associated_cancellation_slot(handler);
        cancelling_ = false;
        if (slot_.is_connected()) slot_.template emplace<cancel_operation>(this);
        handler_ = std::move(handler);
        loop_.enlist(*this);
    }

    void resume(T... values) {
        if (!handler_) return;
        loop_.delist(*this);
        // A slot must not be cleared from inside its own handler; that one has let go of us already.
        if (!std::exchange(cancelling_, false) && slot_.is_connected()) slot_.clear();
        slot_ = {};
        loop_.later([handler = std::move(handler_), values = std::make_tuple(std::move(values)...)]() mutable {
            auto taken = std::move(handler);
            std::apply([&](auto&... value) { taken(std::move(value)...); }, values);
        });
        handler_ = {};
    }

private:
    struct cancel_operation {
        waiter* self;
        explicit cancel_operation(waiter* owner) : self(owner) {}
        void operator()(asio::cancellation_type kind) {
            if (kind == asio::cancellation_type::none) return;
            auto* owner = std::exchange(self, nullptr);
            if (!owner) return;
            owner->cancelling_ = true;
            owner->on_cancel_(); // may destroy *owner
        }
    };

    void drop() noexcept override {
        if (!std::exchange(cancelling_, false) && slot_.is_connected()) slot_.clear();
        slot_ = {};
        auto dropped = std::move(handler_); // what it owns may own this waiter
    }

    loop& loop_;
    unique_function<void()> on_cancel_;
    unique_function<void(T...), 32> handler_;
    asio::cancellation_slot slot_;
    bool cancelling_ = false;
};

} // namespace ise
