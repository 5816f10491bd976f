#pragma once
#include <ise/core/loop.hpp>
#include <ise/core/task.hpp>
#include <ise/core/waiter.hpp>

#include <asio/cancellation_signal.hpp>

#include <exception>
#include <functional>
#include <list>
#include <memory>
#include <string>
#include <vector>

namespace ise {

/// Owns coroutines: each has a name, is cancelled by `stop()` and waited for by `join()`. Used on one loop.
/// The scope must be empty (`size() == 0`) when it is destroyed: stop and join first.
class task_scope {
public:
    /// Called with an exception that escaped from a child, except cancellation after `stop()`.
    using failure_handler = std::function<void(const std::string& name, std::exception_ptr)>;

    task_scope(loop& owner, failure_handler on_failure);
    ~task_scope();
    task_scope(const task_scope&) = delete;
    task_scope& operator=(const task_scope&) = delete;

    /// Starts `body` on the loop's executor (or `executor`, which must belong to it), at the next turn at the latest.
    /// Returns the child's own cancellation, valid until it ends; null if it has ended already, and after `stop()`,
    /// when nothing is started.
    asio::cancellation_signal* spawn(std::string name, task<> body);
    asio::cancellation_signal* spawn(std::string name, task<> body, asio::any_io_executor executor);

    /// Cancels every child; they end at their next suspension.
    void stop();
    bool stopping() const noexcept { return stopping_; }

    /// Completes when no child is left. One coroutine at a time. Cancellation: terminal, ends only the wait.
    task<> join();
    /// The same until `at`; false if children are still running then. Cancellation: as `join`.
    task<bool> join_until(time_point at);

    std::size_t size() const noexcept { return roster_->children.size(); }
    /// The names of the running children.
    std::vector<std::string> running() const;

private:
    struct child {
        std::string name;
        asio::cancellation_signal cancel;
    };
    using children = std::list<child>;
    struct roster {        // shared: a child that is torn down late must still find its signal
        task_scope* scope; // null once that is gone
        task_scope::children children;
    };
    struct starting { // the child that is being started, while it runs for the first time
        child* who = nullptr;
        bool* gone = nullptr;
    };

    void ended(children::iterator who, std::exception_ptr problem);

    loop& loop_;
    failure_handler on_failure_;
    std::shared_ptr<roster> roster_;
    waiter<> empty_;
    starting starting_;
    bool stopping_ = false;
};

/// Whether an exception means that a coroutine was cancelled.
bool is_cancellation(const std::exception_ptr& problem) noexcept;

/// The text of any exception, for a log or a peer.
std::string describe(const std::exception_ptr& problem);

} // namespace ise
