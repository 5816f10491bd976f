#pragma once
#include <ise/core/asio_names.hpp>
#include <ise/core/loop.hpp>
#include <ise/core/task.hpp>
#include <ise/core/waiter.hpp>

#include <exception>
#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace ise {

/// Owns coroutines, and what works without one: each has a name, is cancelled by `stop()` and waited for by `join()`.
/// Used on one loop. The scope must be empty (`size() == 0`) when it is destroyed: stop and join first.
class task_scope {
public:
    /// Anything that a scope owns: a coroutine, or a connection.
    class member {
    public:
        member(const member&) = delete;
        member& operator=(const member&) = delete;

        virtual std::string name() const = 0;
        /// It ends soon.
        virtual void cancel() = 0;

    protected:
        member() = default;
        ~member() { leave(); }
        /// It has ended. May destroy *this.
        void leave() noexcept;
        task_scope* scope() const noexcept { return scope_; }

    private:
        friend class task_scope;
        task_scope* scope_ = nullptr; // null: it has left
        std::size_t place_ = 0;       // among the scope's members
    };

    /// Called with an exception that escaped from a child, except cancellation after `stop()`.
    using failure_handler = std::function<void(const std::string& name, std::exception_ptr)>;

    task_scope(loop& owner, failure_handler on_failure);
    ~task_scope();
    task_scope(const task_scope&) = delete;
    task_scope& operator=(const task_scope&) = delete;

    /// Starts `body` on the loop's executor (or `executor`, which must belong to it), at the next turn at the latest.
    /// Returns what cancels the child, valid until it ends; null if it has ended already, and after `stop()`, when
    /// nothing is started.
    async_stack* spawn(std::string name, task<> body);
    async_stack* spawn(std::string name, task<> body, const asio::any_io_executor& executor);

    /// Keeps `what` until it leaves. False, and nothing is kept, after `stop()`.
    bool add(std::shared_ptr<member> what);

    /// Cancels every child; coroutines end at their next suspension.
    void stop();
    bool stopping() const noexcept { return stopping_; }

    /// Completes when no child is left. Cancellation: terminal, ends only the wait.
    task<> join();
    /// The same until `at`; false if children are still running then. Cancellation: as `join`.
    task<bool> join_until(time_point at);

    std::size_t size() const noexcept { return members_.size(); }
    /// The names of the running children.
    std::vector<std::string> running() const;

private:
    class child;

    void failed(const std::string& name, const std::exception_ptr& problem);

    loop& loop_;
    failure_handler on_failure_;
    std::vector<std::shared_ptr<member>> members_; // a coroutine belongs to what it waits for, and is not owned here
    std::vector<waiter<>*> joining_;
    bool stopping_ = false;
};

/// Whether an exception means that a coroutine was cancelled.
bool is_cancellation(const std::exception_ptr& problem) noexcept;

/// The text of any exception, for a log or a peer.
std::string describe(const std::exception_ptr& problem);

} // namespace ise
