#pragma once
#include "deployments.hpp"
#include "json.hpp"

#include <ise/core/task_scope.hpp>

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace ise::cli {

/// What `--json` prints of a step of a plan.
struct planned_difference {
    std::string what, is, wanted;
    bool in_place = false;
};
struct planned_step {
    std::string_view action; ///< "start", "change", "restart" or "stop"
    std::string path, host, reason;
    std::vector<planned_difference> differences;
    if_any<std::uint64_t> step, of;     ///< its number among how many; only while the plan is executed, as what follows
    if_any<std::string> state, outcome; ///< "begun", "done", "failed", "undone" or "not undone", and how
};
planned_step planned_step_of(const deployment::step& of);

/// Executes the steps of a plan, several at a time where none has to wait for the other, and tells what happens
/// while it happens.
class plan_executor {
public:
    plan_executor(context& in, fleet& there);
    ~plan_executor();
    plan_executor(const plan_executor&) = delete;
    plan_executor& operator=(const plan_executor&) = delete;

    struct manner {
        bool undo = true;
        bool all = false;
        bool forget = false;
    };
    /// All of them. Where one fails, or Ctrl-C is pressed, nothing more is begun, and with `undo` what was done is
    /// undone, in the opposite order; then throws problem with the reason. With `all` the others are done even where
    /// some fail (all of them to their end: what has to wait for a failed one is done after it). With `forget` nothing
    /// is kept of what is stopped. Cancellation: terminal; what is being done is given up.
    task<> execute(std::vector<deployment::step> steps, manner how);

private:
    enum class phase : std::uint8_t { waiting, begun, done, failed };
    struct job {
        deployment::step what;
        phase now = phase::waiting;
        std::optional<instantiation::start_request> former; ///< of what was changed
        std::uint64_t undo = 0;                             ///< undoes that
        async_stack* cancel = nullptr;                      ///< while it is begun
    };

    bool may_begin(const job& one) const;
    bool begin_some(); // whether there was any
    task<> execute_one(std::size_t number);
    task<std::string> act(job& one);
    void on_interrupt();
    task<> wait_for_change();
    task<> give_up();
    task<bool> undo(job& one);
    task<> undo_one(const job& one);
    task<> forget(const deployment::step& what);

    task<instantiation::change_response> change_to(std::string server, instantiation::start_request to,
                                                   std::uint64_t undo);
    task<instantiation::ended_response> stop(std::string server, std::string path, bool forget);
    duration limit_of(const deployment::step& what) const;
    duration room_in(const instantiation::start_response& response) const;
    std::string ready_text(const instantiation::instance_info& what, time_point began) const;
    task<> tell(std::size_t number, std::string state, std::string outcome);
    task<> say(std::string text);

    context& in_;
    fleet& there_;
    manner how_;
    std::vector<job> jobs_;
    std::vector<std::size_t> done_; // in the order in which they were
    std::size_t begun_ = 0;
    std::optional<problem> why_; // of the first that failed
    bool interrupted_ = false;
    waiter<>* changed_ = nullptr;
    std::string unsaid_; // while something is being written
    bool saying_ = false;
    task_scope scope_;
};

} // namespace ise::cli
