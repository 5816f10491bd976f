#pragma once
#include <ise/core/unique_function.hpp>

#include <asio/execution.hpp>
#include <asio/execution_context.hpp>

#include <type_traits>
#include <utility>

namespace ise {

/// A loop as its executor sees it.
class loop_queue {
public:
    using work = unique_function<void(), 96>;

    /// Runs `what` soon. Once the loop has ended it is kept until the queue goes, and dropped then. Thread-safe.
    virtual void post(work what) = 0;
    /// Whether the calling thread is running the loop.
    virtual bool running_here() const noexcept = 0;
    /// Where objects of Asio register themselves that are made on the loop's executor. Thread-safe.
    virtual asio::execution_context& objects() = 0;

protected:
    ~loop_queue() = default;
};

/// The executor of a loop that is not an io_context. Objects of Asio can be made on it; their completions come to the
/// loop. Lifetime: the loop outlives its use.
class loop_executor {
public:
    explicit loop_executor(loop_queue& of) noexcept : of_(&of) {}

    loop_queue& queue() const noexcept { return *of_; }

    asio::execution_context& query(asio::execution::context_t) const { return of_->objects(); }
    asio::execution::blocking_t query(asio::execution::blocking_t) const noexcept {
        if (never_here_) return asio::execution::blocking.never;
        return asio::execution::blocking.possibly;
    }
    loop_executor require(asio::execution::blocking_t::never_t) const noexcept { return {of_, true}; }
    loop_executor require(asio::execution::blocking_t::possibly_t) const noexcept { return {of_, false}; }

    template <class Function>
    void execute(Function&& function) const {
        if (never_here_ || !of_->running_here()) return of_->post(std::forward<Function>(function));
        std::decay_t<Function> here(std::forward<Function>(function));
        here();
    }

    friend bool operator==(const loop_executor& a, const loop_executor& b) noexcept {
        return a.of_ == b.of_ && a.never_here_ == b.never_here_;
    }
    friend bool operator!=(const loop_executor& a, const loop_executor& b) noexcept { return !(a == b); }

private:
    loop_executor(loop_queue* of, bool never_here) noexcept : of_(of), never_here_(never_here) {}

    loop_queue* of_;
    bool never_here_ = false;
};

} // namespace ise
