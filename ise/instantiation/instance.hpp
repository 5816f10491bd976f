#pragma once
#include <ise/core/waiter.hpp>
#include <ise/instantiation/catalogue.hpp>
#include <ise/instantiation/machine.hpp>
#include <ise/instantiation/output_file.hpp>
#include <ise/instantiation/saved_state.hpp>
#include <ise/instantiation/supervision.hpp>

#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace ise::instantiation {

/// One component that was started here, as long as it is remembered. On the server's loop.
struct instance {
    instance(environment& env, start_request request, launch_plan what, std::shared_ptr<output_file> printed)
        : asked(std::move(request)), plan(std::move(what)), watch(env, asked.terms), output(std::move(printed)) {}

    start_request asked;
    launch_plan plan;
    supervision watch;
    std::shared_ptr<output_file> output; ///< with others of the same process
    /// Of its processes: the same for all lives, so that the next server finds one that could not be recorded.
    std::string mark;
    bool mark_is_own = false;            ///< not that of a process that it shares
    std::string version;                 ///< of the program that it runs (machine::version_of)
    std::optional<start_request> former; ///< before the last change
    std::uint64_t undo = 0;              ///< of that change
    std::deque<time_point> compared;     ///< when its environment variables were compared
    std::unique_ptr<process> running;    ///< null: none does
    std::unique_ptr<timer> due;          ///< wakes `watch`
    std::uint64_t life = 0;              ///< counts processes
    std::uint64_t launched_life = 0;     ///< the last of which a process came
    wall_time since{};
    bool adopted = false;
    std::string obstacle;            ///< why it is not ready yet
    std::uint64_t probed_life = 0;   ///< whose probe is being asked
    std::string probe_trouble;       ///< why its probe fails; empty: it does not
    std::vector<waiter<>*> awaiting; ///< a change of it

    instance_info text() const;
    /// As it was asked for, with the path that it has: another plan of it keeps that.
    start_request asked_again() const;
    /// Whether its environment variables would be others.
    bool other_environment(const start_request& wanted) const;
    saved_instance saved() const;
};

/// What is known already, else what the keeper of the process with that mark recorded.
process_end how_it_ended(process_end result, const std::string& mark, const output_file& printed);

/// Suspends until something of the instance has changed. Cancellation: terminal.
task<> next_change(loop& on, std::shared_ptr<instance> of);

} // namespace ise::instantiation
