#pragma once
#include <components/boat/telecommand_audience.hpp>
#include <components/boat/telecommand_tracker.hpp>

#include <ise/core/trace_id.hpp>

#include <map>

namespace atirma {

/// The trace of a telecommand beyond the radio, which carries its number only: the boat's span of its execution is the
/// `parent` of it (docs/metrics.md).
ise::trace_id trace_of_telecommand(std::uint32_t id) noexcept;

/// The telecommand side of a proxy, whichever its link is: provides `telecommand`, `telecommand_state` and
/// `telecommand_recall` over a tracker. Its component outlives it and gives what is due to the link.
///
///     commands.give = [this] { while (auto due = commands.tracker().next_due(commands.now())) …; return true; };
///     commands.provide();
///     commands.tracker().on_outcome(…);  commands.tracker().on_acknowledgement(…);     // as the link fares,
///     commands.work();                                                                 // then this
class telecommand_service {
public:
    telecommand_service(ise::component& of, link_policy policy);

    /// Gives what is due to the link; called by `work()`, never within itself. False, and nothing was given, while the
    /// link is down: when the component sees it come up, it calls `tracker().on_link_up()` and `work()`.
    std::function<bool()> give;
    /// Whether the link accepts a new telecommand now; its error is the refusal. Preset: it does.
    std::function<ise::result<void>(const telecommand_request&)> admit;
    /// Keeps one that is new or has changed, where the link outlives its process: a new one is refused where it cannot
    /// be kept.
    std::function<ise::result<void>(const tracked_telecommand&)> keep;
    /// The tracker's time. Preset: the steady clock for validities and pauses.
    std::function<tracker_time()> clock;

    /// Provides the services.
    void provide();
    /// Gives what is due, keeps and tells what changed, and looks when to come again.
    void work();

    telecommand_tracker& tracker() noexcept { return tracker_; }
    tracker_time now() const { return clock(); }

private:
    ise::task<telecommand_reply> command(telecommand_request request, ise::time_point deadline);
    void trace(const tracked_telecommand& change);

    ise::component& of_;
    telecommand_tracker tracker_;
    telecommand_audience audience_;
    ise::timer due_;
    struct traced {
        ise::trace_id in; // of the call that asked for it
        ise::time_point since{};
    };
    std::map<std::uint32_t, traced> traces_; // of open ones
    bool working_ = false;
};

} // namespace atirma
