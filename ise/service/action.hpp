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
    Goal goal{};            ///< the user's goal
};

/// The answer to it.
struct action_accepted {
    std::uint32_t before = 0; ///< goals that are executed first
};

/// A run that ended without a result.
struct run_failure {
    std::uint8_t code = 0;      ///< ise::errc
    std::uint8_t execution = 0; ///< ise::execution
    std::string reason;         ///< the message, for people
};

/// The published packet of an action, for the subscriber of one run: progress, and last its outcome.
template <class Feedback, class Result>
struct action_update {
    std::variant<Feedback, Result, run_failure> what; ///< feedback, or the outcome
};

/// A service that executes goals, each for a while: it reports progress, ends with a result or a failure, and can be
/// cancelled. Declared once, in a header that both sides include:
/// `inline constexpr ise::action<waypoint, progress_made, arrival> sail_to{"sail_to"};`
/// On the wire it is a subscription: the goal is the subscribe packet, the outcome the last published one, and
/// unsubscribing cancels it. See docs/actions.md.
template <class Goal, class Feedback, class Result>
class action {
public:
    /// The goal.
    using goal_type = Goal;
    /// The feedback: progress of a run.
    using feedback_type = Feedback;
    /// The result of a successful run.
    using result_type = Result;
    /// The subscription service that carries it.
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

/// The limits of one run, set by its requester.
struct run_options {
    duration deadline{};     ///< for the whole run, on both sides; zero: no limit
    duration idle{};         ///< maximum time without feedback or the outcome; zero: no limit
    duration accept{};       ///< for the provider's acceptance; zero: the component's default deadline
    std::uint32_t depth = 8; ///< maximum unread feedback; beyond, the oldest is dropped, never the outcome

    run_options() = default;
};

/// What happens to a new goal when `concurrent` goals are already running.
enum class when_busy : std::uint8_t {
    refuse, ///< Refuses it: errc::overloaded.
    queue,  ///< Queues it.
    /// Cancels the oldest running goal; the new one starts when its handler has ended. Only the newest waiting goal is
    /// kept.
    replace,
};

/// How an action is provided.
struct action_options {
    std::size_t concurrent = 16;        ///< maximum number of running goals
    when_busy busy = when_busy::refuse; ///< for a new goal beyond `concurrent`
    std::size_t waiting = 64;           ///< maximum number of queued goals; beyond: errc::overloaded
    /// Maximum size of all queued goals; beyond: errc::overloaded.
    std::size_t waiting_bytes = std::size_t{64} << 20;

    action_options() = default;
    /// One run at a time; a new goal replaces it.
    static action_options replacing();
    /// One run at a time; new goals are queued.
    static action_options queueing();
    /// One run at a time; new goals are refused.
    static action_options exclusive();
};

/// The parts of an action whose packets are known at run time only.
struct action_schemas {
    schema goal;     ///< of the goal
    schema feedback; ///< of the feedback
    schema result;   ///< of the result
};
/// Whether the packet types are those of an action (by name and structure).
bool is_action(const packet_types& types) noexcept;
/// The schemas of goal, feedback and result. Requires `is_action(types)`.
action_schemas schemas_of_action(const packet_types& types);

} // namespace ise
