#pragma once
#include <ise/core/async_stack.hpp>
#include <ise/core/loop.hpp>

#include <optional>
#include <system_error>
#include <type_traits>
#include <utility>

namespace ise {

namespace detail {

struct no_value {};

} // namespace detail

/// Of a waiter that does not hear of cancellation.
struct uninterrupted_t {};
inline constexpr uninterrupted_t uninterrupted;

/// Where a coroutine of ISE is suspended: it waits for one completion that somebody on the same loop gives by
/// `resume()`, with a value where T is not void. A value that is a std::error_code is thrown, unless it is none.
///
/// The coroutine goes on at the end of the loop's turn, never inside `resume()`. Cancellation of the waiting
/// coroutine resumes it, with `operation_aborted` as its value, or the first part of it, where T is not void; an
/// `uninterrupted` one goes on waiting. A waiter that waits should be resumed before it is destroyed; what still waits
/// then, or when the loop ends, is destroyed without being resumed.
template <class T = void>
class waiter final : public suspended {
    using value = std::conditional_t<std::is_void_v<T>, detail::no_value, T>;
    using outcome = std::conditional_t<std::is_same_v<T, std::error_code>, void, T>;

public:
    explicit waiter(loop& owner) noexcept : loop_(owner) {}
    waiter(loop& owner, uninterrupted_t) noexcept : loop_(owner), interrupted_(false) {}
    waiter(const waiter&) = delete;
    waiter& operator=(const waiter&) = delete;
    ~waiter() {
        if (!waiting_) return;
        loop_.delist(*this);
        drop();
    }

    bool waiting() const noexcept { return static_cast<bool>(waiting_); }

    /// A coroutine that waits, one at a time.
    class operation : public awaiter {
    public:
        explicit operation(waiter& at) noexcept : at_(&at) {}

        template <class Promise>
        void await_suspend(std::coroutine_handle<Promise> coroutine) {
            at_->begin(*this, coroutine.promise().stack());
        }
        outcome await_resume() {
            if constexpr (std::is_same_v<T, std::error_code>) {
                if (*came_) throw std::system_error(*came_);
            } else if constexpr (!std::is_void_v<T>) {
                return std::move(*came_);
            }
        }
        void cancel() override {
            if (at_) at_->cancel();
        }

    private:
        friend class waiter;
        waiter* at_;
        std::optional<value> came_;
    };

    operation wait() noexcept { return operation(*this); }

    void resume(value with = value{}) {
        if (!waiting_) return;
        loop_.delist(*this);
        operation_->at_ = nullptr;
        operation_->came_.emplace(std::move(with));
        loop_.later([waiting = std::move(waiting_)]() mutable { waiting.resume(); });
    }

private:
    void begin(operation& by, async_stack& stack) {
        auto waiting = stack.suspend(by);
        if (loop_.abandoned()) return; // nothing would ever resume it
        waiting_ = std::move(waiting);
        operation_ = &by;
        loop_.enlist(*this);
    }
    void cancel() {
        if (interrupted_) resume(aborted());
    }
    static value aborted() {
        if constexpr (std::is_void_v<T>) return {};
        else if constexpr (requires { value{detail::operation_aborted()}; }) return value{detail::operation_aborted()};
        else return value(detail::operation_aborted(), typename value::second_type());
    }
    void drop() noexcept override {
        auto dropped = std::move(waiting_); // what it owns may own this waiter
    }

    loop& loop_;
    suspended_stack waiting_;
    operation* operation_ = nullptr;
    bool interrupted_ = true;
};

} // namespace ise
