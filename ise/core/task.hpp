#pragma once
#include <ise/core/async_stack.hpp>
#include <ise/core/frame_pool.hpp>

#include <coroutine>
#include <cstddef>
#include <exception>
#include <optional>
#include <source_location>
#include <type_traits>
#include <utility>

namespace ise {

template <class T = void>
class task;

/// How a task awaits what is none of ISE's own: a specialization has `static auto make(async_stack&, A)`, which returns
/// an awaiter. `<ise/asio.hpp>` has that of `asio::awaitable`.
template <class A>
struct foreign_awaitable;

namespace detail {

template <class T>
inline constexpr bool is_task = false;
template <class T>
inline constexpr bool is_task<task<T>> = true;

template <class T>
class task_awaiter;

/// An operation where it is: as itself g++ 12 would move it into the coroutine's frame.
template <class Operation>
class operation_reference {
public:
    explicit operation_reference(Operation& of) noexcept : of_(&of) {}
    bool await_ready() const { return of_->await_ready(); }
    template <class Promise>
    void await_suspend(std::coroutine_handle<Promise> coroutine) const {
        of_->await_suspend(coroutine);
    }
    decltype(auto) await_resume() const { return of_->await_resume(); }

private:
    Operation* of_;
};

/// What all coroutines of ISE have, whatever they return.
class task_promise_base {
public:
    static void* operator new(std::size_t size) { return frame_pool::allocate(size); }
    static void operator delete(void* frame, std::size_t size) noexcept { frame_pool::release(frame, size); }

    std::suspend_always initial_suspend() const noexcept { return {}; }
    auto final_suspend() noexcept {
        struct to_who_waits {
            task_promise_base& ended;
            bool await_ready() const noexcept { return false; }
            void await_suspend(std::coroutine_handle<>) const noexcept { ended.stack_->pop(ended.who_waits_); }
            void await_resume() const noexcept {}
        };
        return to_who_waits{*this};
    }
    void unhandled_exception() noexcept { thrown_ = std::current_exception(); }

    async_stack& stack() const noexcept { return *stack_; }

    /// Every `co_await` of a cancelled coroutine throws, before it begins anything. `where` is that `co_await`, for an
    /// operation that wants to know.
    template <class A>
    auto await_transform(A&& what,
                         [[maybe_unused]] const std::source_location where = std::source_location::current()) const {
        using plain = std::remove_cvref_t<A>;
        if constexpr (std::is_base_of_v<async_stack::query, plain>) {
            return what.of(*stack_);
        } else {
            stack_->check_cancellation();
            if constexpr (is_task<plain>) {
                static_assert(!std::is_lvalue_reference_v<A>,
                              "ise: a task is awaited once and gone then: co_await std::move(it)");
                return task_awaiter(std::move(what));
            } else if constexpr (std::is_base_of_v<awaiter, plain>) {
                if constexpr (requires { what.awaited_at(where); }) what.awaited_at(where);
                return operation_reference<plain>(what);
            } else {
                static_assert(
                    requires { sizeof(foreign_awaitable<plain>); },
                    "ise: an ise::task awaits tasks and operations of ISE; with <ise/asio.hpp> also operations of Asio "
                    "(token ise::use_task) and asio::awaitable");
                return foreign_awaitable<plain>::make(*stack_, std::forward<A>(what));
            }
        }
    }

protected:
    void rethrow() const {
        if (thrown_) [[unlikely]]
            async_stack::throw_again(thrown_);
    }

private:
    template <class T>
    friend class task_awaiter;
    friend class ise::async_stack;

    async_stack* stack_ = nullptr;
    std::coroutine_handle<> who_waits_; // null: nobody, it is the bottom of its stack
    std::exception_ptr thrown_;
};

template <class T>
class task_promise final : public task_promise_base {
public:
    task<T> get_return_object() noexcept;
    template <class U>
    requires std::is_convertible_v<U&&, T>
    void return_value(U&& value) { value_.emplace(std::forward<U>(value)); }
    T take() {
        rethrow();
        return std::move(*value_);
    }

private:
    std::optional<T> value_;
};

template <>
class task_promise<void> final : public task_promise_base {
public:
    task<void> get_return_object() noexcept;
    void return_void() const noexcept {}
    void take() const { rethrow(); }
};

} // namespace detail

/// A coroutine of ISE. It begins when it is awaited by another one, or started: `component::spawn`, or from Asio with
/// `ise::async_run` (`<ise/asio.hpp>`). Until then, and once it has ended, destroying it only frees it; the end of a
/// coroutine that is suspended is described in docs/coroutines.md.
template <class T>
class [[nodiscard]] task {
public:
    using promise_type = detail::task_promise<T>; ///< for the compiler
    using value_type = T;                         ///< what it returns

    task() noexcept = default;
    /// Moving leaves nothing behind.
    task(task&& other) noexcept : frame_(std::exchange(other.frame_, nullptr)) {}
    /// Frees the coroutine that it held before.
    task& operator=(task&& other) noexcept {
        auto old = std::move(*this);
        frame_ = std::exchange(other.frame_, nullptr);
        return *this;
    }
    ~task() {
        if (frame_) frame_.destroy();
    }

    /// Whether there is a coroutine in it.
    explicit operator bool() const noexcept { return static_cast<bool>(frame_); }

private:
    template <class U>
    friend class detail::task_promise;
    template <class U>
    friend class detail::task_awaiter;
    friend class async_stack;
    explicit task(std::coroutine_handle<promise_type> frame) noexcept : frame_(frame) {}

    std::coroutine_handle<promise_type> frame_;
};

namespace detail {

template <class T>
task<T> task_promise<T>::get_return_object() noexcept {
    return task<T>(std::coroutine_handle<task_promise>::from_promise(*this));
}
inline task<void> task_promise<void>::get_return_object() noexcept {
    return task<void>(std::coroutine_handle<task_promise>::from_promise(*this));
}

/// One coroutine waits for another, which runs on the same stack.
template <class T>
class task_awaiter {
public:
    explicit task_awaiter(task<T>&& child) noexcept : child_(std::move(child)) {}

    bool await_ready() const noexcept { return false; }
    template <class Promise>
    void await_suspend(std::coroutine_handle<Promise> parent) const noexcept {
        auto& promise = child_.frame_.promise();
        promise.stack_ = &parent.promise().stack();
        promise.who_waits_ = parent;
        promise.stack_->push(child_.frame_);
    }
    T await_resume() const { return child_.frame_.promise().take(); }

private:
    task<T> child_;
};

} // namespace detail

/// An operation, such as `remote::call`, as a task, for functions that accept only tasks.
template <class Operation>
requires std::is_base_of_v<awaiter, Operation>
auto as_task(Operation what) -> task<decltype(what.await_resume())> { co_return co_await std::move(what); }

/// @cond
template <class T>
void async_stack::begin(task<T>& bottom) noexcept {
    bottom.frame_.promise().stack_ = this;
    top_ = bottom.frame_;
}

template <class T>
T async_stack::outcome_of(task<T>& bottom) {
    return bottom.frame_.promise().take();
}
/// @endcond

} // namespace ise
