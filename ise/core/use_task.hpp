#pragma once
#include <ise/core/asio_configuration.hpp>
#include <ise/core/task.hpp>

#include <asio/any_io_executor.hpp>
#include <asio/associated_executor.hpp>
#include <asio/async_result.hpp>
#include <asio/awaitable.hpp>
#include <asio/cancellation_signal.hpp>
#include <asio/co_spawn.hpp>

#include <exception>
#include <optional>
#include <system_error>
#include <tuple>
#include <type_traits>
#include <utility>

namespace ise {

/// The completion token with which an `ise::task` awaits an operation of Asio:
/// `co_await timer.async_wait(ise::use_task)`. An error is thrown as std::system_error, further values are returned,
/// several of them as a tuple. The operation begins when it is awaited, and completes on the task's executor.
/// Cancellation: terminal, the operation's own.
struct use_task_t {
    constexpr use_task_t() noexcept = default;
};
/// See `use_task_t`.
inline constexpr use_task_t use_task;

namespace detail {

template <class... Values>
struct joined_values {
    using type = std::tuple<Values...>;
};
template <class Value>
struct joined_values<Value> {
    using type = Value;
};
template <>
struct joined_values<> {
    using type = void;
};

inline void throw_problem(const std::error_code& why) {
    if (why) throw std::system_error(why);
}
inline void throw_problem(const std::exception_ptr& why) {
    if (why) std::rethrow_exception(why);
}

/// What an operation of Asio completes with, and what `co_await` makes of it.
template <class... Values>
class completion_values {
public:
    using type = typename joined_values<Values...>::type;
    void set(Values... values) { came_.emplace(std::move(values)...); }
    type take() {
        if constexpr (sizeof...(Values) == 1) return std::get<0>(std::move(*came_));
        else if constexpr (sizeof...(Values) > 1) return std::move(*came_);
    }

private:
    std::optional<std::tuple<Values...>> came_;
};

template <class Problem, class... Values>
requires std::is_same_v<Problem, std::error_code> || std::is_same_v<Problem, std::exception_ptr>
class completion_values<Problem, Values...> {
public:
    using type = typename joined_values<Values...>::type;
    void set(Problem why, Values... values) {
        why_ = std::move(why);
        came_.emplace(std::move(values)...);
    }
    type take() {
        throw_problem(why_);
        if constexpr (sizeof...(Values) == 1) return std::get<0>(std::move(*came_));
        else if constexpr (sizeof...(Values) > 1) return std::move(*came_);
    }

private:
    Problem why_;
    std::optional<std::tuple<Values...>> came_;
};

/// An operation of Asio that an `ise::task` awaits. Made in place: it does not move.
template <class Initiation, class Given, class... Values>
class asio_operation final : public awaiter {
public:
    template <class... Arguments>
    explicit asio_operation(Initiation initiation, Arguments&&... arguments)
        : initiation_(std::move(initiation)), given_(std::forward<Arguments>(arguments)...) {}

    template <class Promise>
    void await_suspend(std::coroutine_handle<Promise> coroutine) {
        auto begun = [&](auto&&... given) {
            std::move(initiation_)(handler(*this, coroutine.promise().stack().suspend(*this)), std::move(given)...);
        };
        std::apply(begun, std::move(given_));
    }
    auto await_resume() { return values_.take(); }
    void cancel() override { cancel_.emit(asio::cancellation_type::terminal); }

private:
    class handler {
    public:
        using executor_type = asio::any_io_executor;
        using cancellation_slot_type = asio::cancellation_slot;

        handler(asio_operation& of, suspended_stack waiting) noexcept : of_(&of), waiting_(std::move(waiting)) {}

        executor_type get_executor() const noexcept { return waiting_.stack().executor(); }
        cancellation_slot_type get_cancellation_slot() const noexcept { return of_->cancel_.slot(); }

        template <class... Came>
        void operator()(Came&&... came) {
            of_->values_.set(std::forward<Came>(came)...);
            waiting_.resume();
        }

    private:
        asio_operation* of_;
        suspended_stack waiting_;
    };

    Initiation initiation_;
    Given given_;
    asio::cancellation_signal cancel_;
    completion_values<Values...> values_;
};

} // namespace detail

/// A task awaits an `asio::awaitable` by running it on its own executor.
template <class T, class Executor>
struct foreign_awaitable<asio::awaitable<T, Executor>> {
    static auto make(async_stack& on, asio::awaitable<T, Executor> what) {
        return asio::co_spawn(on.executor(), std::move(what), use_task);
    }
};

} // namespace ise

/// @cond
template <class Result, class... Values>
class asio::async_result<ise::use_task_t, Result(Values...)> {
public:
    template <class Initiation, class... Given>
    static auto initiate(Initiation initiation, ise::use_task_t, Given... given) {
        return ise::detail::asio_operation<Initiation, std::tuple<Given...>, std::decay_t<Values>...>(
            std::move(initiation), std::move(given)...);
    }
};
/// @endcond
