#pragma once
#include <ise/core/bytes.hpp>
#include <ise/core/loop.hpp>
#include <ise/core/result.hpp>
#include <ise/core/task.hpp>
#include <ise/packet/codec.hpp>
#include <ise/service/action.hpp>
#include <ise/subscription/publication_core.hpp>
#include <ise/subscription/subscriber_group.hpp>

#include <cstdint>
#include <deque>
#include <functional>
#include <list>
#include <memory>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>

namespace ise {

class action_runs;
class async_stack;
class service_runtime;

/// One run at the provider, without its types.
struct provided_run {
    provided_run(std::weak_ptr<action_runs> of, loop& on);

    run_id id{};
    std::uint64_t number = 0;     ///< counted, for those who watch
    std::string requester;        ///< its path and its address, for people
    std::string who;              ///< the requester's verified identity
    std::uint64_t subscriber = 0; ///< its number; 0: nobody wants it any more
    bytes goal;                   ///< until it is executed
    enum class state : std::uint8_t { waiting, running, ended } is = state::waiting;
    async_stack* coroutine = nullptr;
    std::optional<failure> cause; ///< why it was cancelled
    bytes latest;                 ///< the last report as an update, for a requester that comes back
    bytes outcome;                ///< the last update, once it has ended
    std::weak_ptr<action_runs> owner;
    timer deadline;
};

/// The runs of one provided action: begins, cancels and remembers them, and publishes to each requester what concerns
/// its run. Owned by the callbacks of its publication.
class action_runs final : public std::enable_shared_from_this<action_runs> {
public:
    /// Executes the goal of a run; gives the encoded result.
    using executor = std::function<task<bytes>(std::shared_ptr<provided_run>)>;

    /// A publication that has such runs.
    static std::shared_ptr<publication_core> make(service_runtime& runtime, std::string name, const packet_types& types,
                                                  action_options options, executor execute);

    /// Publishes a report (encoded), then lets others run. Cancellation: terminal, throws `operation_aborted`.
    static task<> report(std::shared_ptr<provided_run> run, bytes feedback);
    void on_deadline(provided_run& run);

private:
    using held_run = std::shared_ptr<provided_run>;
    action_runs(service_runtime& runtime, std::string name, action_options options, executor execute);

    result<bytes> accept(bytes_view request, const adapter* adapt, const subscriber_info& who);
    void remove(const subscriber_info& who);
    std::optional<failure> make_room(std::size_t goal, std::size_t& before);
    void launch(const held_run& run);
    static task<> execute(std::shared_ptr<action_runs> self, held_run run);
    void end(const held_run& run, std::optional<failure> why, bytes result);
    void begin_next();
    void cancel(provided_run& run, failure why);
    void forget(const provided_run& run);
    void tell(const provided_run& run, const bytes& update);
    void tap(const provided_run& run, std::uint8_t part, bytes_view packet) const;
    void tell_again(const run_id& id);
    held_run find(const run_id& id) const;
    std::size_t running() const noexcept;

    service_runtime& runtime_;
    std::string name_;
    action_options options_;
    executor execute_;
    std::weak_ptr<publication_core> out_;
    std::list<held_run> all_; // in the order in which they came
    std::deque<run_id> gone_; // were here, the last ones: they are not begun again
    std::uint64_t accepted_ = 0;
};

/// Reports the progress of the run that a handler executes: `co_await progress(feedback)`. A value; used on the
/// component's loop while the handler runs.
template <class Feedback>
class progress {
public:
    /// Made by the provider.
    explicit progress(std::shared_ptr<provided_run> run) noexcept : run_(std::move(run)) {}

    /// Publishes to the requester, and lets other coroutines run once. Cancellation: terminal, throws
    /// `operation_aborted`, also when the run was cancelled before: so a handler that does nothing but report ends.
    /// The report is encoded before this returns.
    task<> operator()(const Feedback& feedback) const { return action_runs::report(run_, encode(feedback)); }

private:
    std::shared_ptr<provided_run> run_;
};

/// Implementation of `component::provide` of an action: `handler` is `ise::task<Result>(Goal, progress<Feedback>)`.
template <class Goal, class Feedback, class Result, class Handler>
std::shared_ptr<publication_core> make_action(service_runtime& runtime, const action<Goal, Feedback, Result>& service,
                                              Handler handler, action_options options = action_options()) {
    static_assert(std::is_invocable_r_v<task<Result>, Handler&, Goal, progress<Feedback>>,
                  "ise: the handler of an action is a coroutine ise::task<Result>(Goal, ise::progress<Feedback>)");
    auto shared = std::make_shared<Handler>(std::move(handler));
    action_runs::executor execute = [shared](std::shared_ptr<provided_run> run) -> task<bytes> {
        Goal goal{};
        decode_into(goal, run->goal);
        run->goal = bytes(); // the handler has its own
        progress<Feedback> report(run);
        auto handling = (*shared)(std::move(goal), std::move(report));
        auto made = co_await std::move(handling);
        co_return encode(made);
    };
    return action_runs::make(runtime, std::string(service.name()), service.types(), options, std::move(execute));
}

} // namespace ise
