#pragma once
#include <ise/core/asio_names.hpp>
#include <ise/core/trace_id.hpp>

#include <coroutine>
#include <cstdint>
#include <exception>
#include <system_error>
#include <utility>

namespace ise {

template <class T>
class task;
class async_stack;

namespace detail {

std::error_code operation_aborted() noexcept;

} // namespace detail

/// The right to go on with a suspended stack, which whatever it waits for has: `resume()` it once. Destroying it
/// without that destroys the stack and all its coroutines.
class suspended_stack {
public:
    suspended_stack() noexcept = default;
    explicit suspended_stack(async_stack& of) noexcept : stack_(&of) {}
    suspended_stack(suspended_stack&& other) noexcept : stack_(std::exchange(other.stack_, nullptr)) {}
    suspended_stack& operator=(suspended_stack&& other) noexcept {
        auto old = std::move(*this);
        stack_ = std::exchange(other.stack_, nullptr);
        return *this;
    }
    ~suspended_stack();

    explicit operator bool() const noexcept { return stack_ != nullptr; }
    async_stack& stack() const noexcept { return *stack_; }

    /// On the stack's executor. Runs its coroutines until they are suspended again or have ended; within the call that
    /// suspends them they go on when that returns.
    void resume();

private:
    async_stack* stack_ = nullptr;
};

/// What a stack is suspended at: the base of every operation of ISE that a coroutine awaits.
class awaiter {
public:
    bool await_ready() const noexcept { return false; }

    /// The coroutine that waits is cancelled. Whoever completes the operation does so soon, with what it ended with.
    virtual void cancel() = 0;

protected:
    awaiter() = default;
    awaiter(const awaiter&) = default;
    awaiter& operator=(const awaiter&) = default;
    ~awaiter() = default;
};

/// The coroutines that wait for one another, of which the top one runs or is suspended at an operation, and what they
/// have in common: where they run, and whether they are cancelled. Used on its executor, on which nothing runs
/// concurrently.
class async_stack {
public:
    async_stack(const async_stack&) = delete;
    async_stack& operator=(const async_stack&) = delete;

    const asio::any_io_executor& executor() const noexcept { return *executor_; }

    /// Ends what its top coroutine waits for, and lets every later `co_await` throw `operation_aborted`.
    void cancel();
    bool cancelled() const noexcept { return cancelled_; }

    /// Throws std::system_error with `asio::error::operation_aborted` if it was cancelled.
    void check_cancellation() const {
        if (cancelled_) throw_cancelled();
    }
    void accept_cancellation(bool accepts) noexcept {
        cancelled_ = false;
        accepts_cancellation_ = accepts;
    }

    /// For an operation that begins: the coroutine that awaits it is suspended until the result of this is resumed.
    suspended_stack suspend(awaiter& at) noexcept {
        suspended_at_ = &at;
        return suspended_stack(*this);
    }

    // For coroutines. The stack goes on with another one; null: the bottom one has ended.
    void push(std::coroutine_handle<> called) noexcept {
        top_ = called;
        phase_ = phase::goes_on;
    }
    void pop(std::coroutine_handle<> returned_to) noexcept {
        top_ = returned_to;
        phase_ = returned_to ? phase::goes_on : phase::runs;
    }

    [[noreturn]] static void throw_again(const std::exception_ptr& what);

    /// What is asked of the stack by `co_await` without waiting; see `this_task`.
    class query {};

protected:
    /// The executor lives as long as the stack can be resumed.
    explicit async_stack(const asio::any_io_executor& executor) noexcept : executor_(&executor) {}
    /// Whoever derives from it has destroyed its bottom coroutine.
    ~async_stack() = default;

    /// `bottom` is the coroutine with which it begins when it is resumed for the first time.
    template <class T>
    void begin(task<T>& bottom) noexcept;
    /// What the bottom coroutine returned; throws what it threw.
    template <class T>
    static T outcome_of(task<T>& bottom);

    /// The bottom coroutine has ended. May destroy *this.
    virtual void on_end() = 0;
    /// It will never be resumed: destroys the bottom coroutine, and so all others. May destroy *this.
    virtual void on_drop() noexcept = 0;

private:
    friend class suspended_stack;
    enum class phase : std::uint8_t {
        suspended,
        runs,
        goes_on, // runs, and shall go on at the top
        dropped, // while it ran
    };

    void go_on();
    void drop() noexcept;
    [[noreturn]] static void throw_cancelled();

    std::coroutine_handle<> top_;
    awaiter* suspended_at_ = nullptr;
    phase phase_ = phase::suspended;
    bool cancelled_ = false;
    bool accepts_cancellation_ = true;
    const asio::any_io_executor* executor_;
    detail::trace_place trace_;
};

inline suspended_stack::~suspended_stack() {
    if (stack_) stack_->drop();
}

inline void suspended_stack::resume() { std::exchange(stack_, nullptr)->go_on(); }

/// Queries of a coroutine to its task. They never wait, and work in a cancelled task too.
namespace this_task {

namespace detail {

template <class T>
struct answer {
    T value;
    bool await_ready() const noexcept { return true; }
    void await_suspend(std::coroutine_handle<>) const noexcept {}
    T await_resume() const { return value; }
};
struct done {
    bool await_ready() const noexcept { return true; }
    void await_suspend(std::coroutine_handle<>) const noexcept {}
    void await_resume() const noexcept {}
};

struct executor_query : async_stack::query {
    answer<const asio::any_io_executor&> of(const async_stack& stack) const noexcept { return {stack.executor()}; }
};
struct cancelled_query : async_stack::query {
    answer<bool> of(const async_stack& stack) const noexcept { return {stack.cancelled()}; }
};
struct accepting_query : async_stack::query {
    explicit constexpr accepting_query(bool accepting) noexcept : accepts(accepting) {}
    bool accepts;
    done of(async_stack& stack) const noexcept {
        stack.accept_cancellation(accepts);
        return {};
    }
};

} // namespace detail

/// `co_await ise::this_task::executor`: where it runs, with the context of the call that it handles. Copy it to keep it
/// for longer than the task. Using it needs <ise/asio.hpp>.
inline constexpr detail::executor_query executor{};
/// `co_await ise::this_task::cancelled`: whether it was cancelled since it began or last forgot it.
inline constexpr detail::cancelled_query cancelled{};
/// `co_await ise::this_task::forget_cancellation`: it can wait again, for cleaning up, and be cancelled again.
inline constexpr detail::accepting_query forget_cancellation{true};
/// `co_await ise::this_task::ignore_cancellation`: from now on it is not cancelled, until `forget_cancellation`.
inline constexpr detail::accepting_query ignore_cancellation{false};

} // namespace this_task
} // namespace ise
