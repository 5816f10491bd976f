#pragma once
#include <ise/core/time.hpp>
#include <ise/packet/schema.hpp>
#include <ise/session/contract.hpp>

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <variant>

namespace ise {

class dynamic_contract;

/// What stands before the goal in an action's subscribe packet, at these places of its bytes.
namespace action_layout {
inline constexpr std::size_t run = 0;    ///< 16 bytes
inline constexpr std::size_t life = 16;  ///< u64
inline constexpr std::size_t known = 24; ///< bool
inline constexpr std::size_t time = 25;  ///< i64
inline constexpr std::size_t goal = 33;  ///< the goal's bytes
} // namespace action_layout

/// Names a run: random, and so unguessable; a peer of the same identity that has it takes the run over.
using run_id = std::array<std::uint8_t, 16>;

/// The subscribe packet of an action (FORMAT.md, "Actions").
template <class Goal>
struct action_goal {
    run_id run{};           ///< the run that it begins; or, if it is there already, that it comes back to
    std::uint64_t life = 0; ///< the incarnation of the provider to which it was sent first; 0: it was not sent before
    bool known = false;     ///< the provider has accepted it: it must not begin again
    duration time{};        ///< for the whole run; 0: no limit
    Goal goal{};
};

/// The answer to it.
struct action_accepted {
    std::uint32_t before = 0; ///< goals that are executed first
};

/// A run that ended without a result.
struct run_failure {
    std::uint8_t code = 0;      ///< ise::errc
    std::uint8_t execution = 0; ///< ise::execution
    std::string reason;
};

/// The published packet of an action, for the subscriber of one run: progress, and last its outcome.
template <class Feedback, class Result>
struct action_update {
    std::variant<Feedback, Result, run_failure> what;
};

/// A service that executes goals, each for a while: it reports progress, ends with a result or a failure, and can be
/// cancelled. Declared once, in a header that both sides include:
/// `inline constexpr ise::action<waypoint, progress_made, arrival> sail_to{"sail_to"};`
/// On the wire it is a subscription: the goal is the subscribe packet, the outcome the last published one, and
/// unsubscribing cancels it. docs/actions.md says when to use which.
template <class Goal, class Feedback, class Result>
class action {
public:
    /// What is to be done.
    using goal_type = Goal;
    /// A report of progress.
    using feedback_type = Feedback;
    /// What a run ends with.
    using result_type = Result;
    /// The subscription that it is.
    using service_type = subscription<action_update<Feedback, Result>, action_goal<Goal>, action_accepted>;

    /// `name` must be a string literal; it is not copied.
    constexpr explicit action(std::string_view name) : name_(name) {}
    /// The name of the service, unique within its component.
    constexpr std::string_view name() const noexcept { return name_; }

    /// The service without its types.
    service_key key() const { return service_type(name_).key(); }
    /// The schemas of its packets, made once.
    static const packet_types& types() { return service_type::types(); }

private:
    std::string_view name_;
};

/// What a requester allows for a run.
struct run_options {
    duration deadline{};     ///< for the whole run, at either end; zero: no limit
    duration idle{};         ///< the longest time without a report or the outcome; zero: no limit
    duration accept{};       ///< for the first answer; zero: the component's default
    std::uint32_t depth = 8; ///< reports that wait to be taken; beyond, the oldest is dropped, never the outcome

    run_options() = default;
};

/// What a goal meets that comes while as many runs as may be are executed.
enum class when_busy : std::uint8_t {
    refuse,  ///< it is refused: errc::overloaded
    queue,   ///< it waits for its turn
    replace, ///< the oldest run is cancelled, and it begins when that has ended; of several that wait, the newest
};

/// How an action is provided.
struct action_options {
    std::size_t concurrent = 16;        ///< runs that are executed at once
    when_busy busy = when_busy::refuse; ///< the next goal
    std::size_t waiting = 64;           ///< goals in the queue; beyond, errc::overloaded

    action_options() = default;
    /// One run at a time; a new goal takes its place.
    static action_options replacing();
    /// One run at a time; new goals wait.
    static action_options queueing();
    /// One run at a time; new goals are refused.
    static action_options exclusive();
};

/// The parts of an action whose packets are known at run time only.
struct action_schemas {
    schema goal, feedback, result;
};
/// Whether a service is an action: as its packets are called and look.
bool is_action(const packet_types& types) noexcept;
/// Only where it is one.
action_schemas schemas_of_action(const packet_types& types);

} // namespace ise
