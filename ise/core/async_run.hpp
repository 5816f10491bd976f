#pragma once
#include <ise/core/asio_configuration.hpp>
#include <ise/core/frame_pool.hpp>
#include <ise/core/task.hpp>

#include <asio/any_io_executor.hpp>
#include <asio/associated_cancellation_slot.hpp>
#include <asio/associated_executor.hpp>
#include <asio/async_result.hpp>
#include <asio/dispatch.hpp>
#include <asio/executor_work_guard.hpp>

#include <exception>
#include <memory>
#include <optional>
#include <tuple>
#include <utility>

namespace ise {
namespace detail {

/// A task that was started from Asio, and the handler of what it returns.
template <class T, class Handler>
class run_stack final : public async_stack {
    using handler_executor = asio::associated_executor_t<Handler, asio::any_io_executor>;

public:
    run_stack(const asio::any_io_executor& on, task<T> bottom, Handler handler)
        : async_stack(on_), on_(on), bottom_(std::move(bottom)), handler_(std::move(handler)), work_(on),
          handler_work_(asio::get_associated_executor(handler_, on)),
          slot_(asio::get_associated_cancellation_slot(handler_)) {
        begin(bottom_);
        if (slot_.is_connected()) slot_.template emplace<cancel_operation>(this);
    }

    static void* operator new(std::size_t size) { return frame_pool::allocate(size); }
    static void operator delete(void* memory, std::size_t size) noexcept { frame_pool::release(memory, size); }

private:
    struct cancel_operation {
        run_stack* of;
        explicit cancel_operation(run_stack* stack) noexcept : of(stack) {}
        void operator()(asio::cancellation_type kind) {
            if ((kind & asio::cancellation_type::terminal) == asio::cancellation_type::none) return;
            // The stack may end within this, and must not clear the slot whose handler this is.
            auto* cancelled = of;
            cancelled->cancelling_ = true;
            bool ended = false;
            cancelled->ended_ = &ended;
            cancelled->cancel();
            if (ended) return;
            cancelled->cancelling_ = false;
            cancelled->ended_ = nullptr;
        }
    };

    void let_go() noexcept {
        if (ended_) *ended_ = true;
        if (!cancelling_ && slot_.is_connected()) slot_.clear();
    }

    void on_end() override {
        let_go();
        std::exception_ptr thrown;
        auto complete = [&](auto&&... value) {
            auto work = std::move(handler_work_);
            auto back = work.get_executor();
            auto done = [handler = std::move(handler_), thrown,
                         came = std::tuple<std::decay_t<decltype(value)>...>(std::move(value)...)]() mutable {
                auto taken = std::move(handler);
                std::apply([&](auto&... one) { taken(thrown, std::move(one)...); }, came);
            };
            auto on = std::move(on_); // its work, until the handler has run
            auto work_here = std::move(work_);
            delete this;
            asio::dispatch(back, std::move(done));
        };
        if constexpr (std::is_void_v<T>) {
            try {
                outcome_of(bottom_);
            } catch (...) {
                thrown = std::current_exception();
            }
            complete();
        } else {
            std::optional<T> value;
            try {
                value.emplace(outcome_of(bottom_));
            } catch (...) {
                thrown = std::current_exception();
                value.emplace();
            }
            complete(std::move(*value));
        }
    }

    void on_drop() noexcept override {
        let_go();
        delete this;
    }

    asio::any_io_executor on_;
    task<T> bottom_;
    Handler handler_;
    asio::executor_work_guard<asio::any_io_executor> work_;
    asio::executor_work_guard<handler_executor> handler_work_;
    asio::cancellation_slot slot_;
    bool cancelling_ = false;
    bool* ended_ = nullptr;
};

template <class T>
struct run_signature {
    using type = void(std::exception_ptr, T);
};
template <>
struct run_signature<void> {
    using type = void(std::exception_ptr);
};

} // namespace detail

/// Starts a task on `on`, an executor on which nothing runs concurrently (a component's, a strand, an `io_context` with
/// one thread): at once where that is allowed. Completes as `void(std::exception_ptr, T)`, or without the T of a
/// `task<>`, on the handler's executor; T is default-constructible. Cancellation: terminal, cancels the task.
template <class T, class Token>
auto async_run(asio::any_io_executor on, task<T> what, Token&& token) {
    return asio::async_initiate<Token, typename detail::run_signature<T>::type>(
        // It has the executor, since g++ takes a closure without captures for one that is not initialized.
        [on = std::move(on)](auto handler, task<T> bottom) {
            using stack = detail::run_stack<T, decltype(handler)>;
            suspended_stack first(*new stack(on, std::move(bottom), std::move(handler)));
            asio::dispatch(on, [first = std::move(first)]() mutable { first.resume(); });
        },
        token, std::move(what));
}

} // namespace ise
