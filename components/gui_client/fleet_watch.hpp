#pragma once
#include <components/gui_client/view.hpp>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace atirma::console {

/// An alarm of one of the boats.
struct fleet_alarm {
    std::size_t boat = 0; ///< its place in the fleet
    alarm_entry alarm;
};

/// A line of the log of alarms of all boats.
struct fleet_event {
    std::size_t boat = 0;
    alarm_event event;
};

/// A call of an alarm to the operator.
struct fleet_call {
    std::size_t boat = 0;
    severity how = severity::notice;
    std::string text;
};

/// The boats of one console, each followed by a `gui_client` of its own: the newest snapshot of each, and the alarms of
/// all. A boat that is not shown calls the operator as the shown one does. Pure; not thread-safe.
class fleet_watch {
public:
    /// One name for each boat, at least one.
    explicit fleet_watch(std::vector<std::string> names);

    std::size_t size() const noexcept { return boats_.size(); }
    const std::string& name(std::size_t boat) const { return boats_.at(boat).name; }
    /// Never null.
    const std::shared_ptr<const snapshot>& seen(std::size_t boat) const { return boats_.at(boat).seen; }
    void take(std::size_t boat, std::shared_ptr<const snapshot> seen);

    /// The component of that boat has ended, for good: nothing newer comes.
    void end(std::size_t boat, std::string why) { boats_.at(boat).ended = std::move(why); }
    /// Why; empty: it runs.
    const std::string& ended(std::size_t boat) const { return boats_.at(boat).ended; }
    /// A boat whose component has ended, `shown` before the others.
    std::optional<std::size_t> first_ended(std::size_t shown) const;

    /// The most severe call since the last one; of equal ones that of the first boat. The others count as heard: they
    /// sound at the same time.
    std::optional<fleet_call> next_call();
    /// The events of the alarms of all boats since the last call of this, in the order of time.
    std::vector<fleet_event> take_events();
    /// The unacknowledged alarms of all boats: the most severe first, of equal ones those of the boat `shown`, then the
    /// newest. Without those of a boat whose component has ended: nobody can acknowledge them.
    std::vector<fleet_alarm> open_alarms(std::size_t shown) const;
    /// "boat-2: The battery is low"; the text alone where there is one boat.
    std::string labelled(std::size_t boat, const std::string& text) const;

private:
    struct watched {
        std::string name;
        std::shared_ptr<const snapshot> seen;
        std::string ended;
        std::uint64_t calls_heard = 0, events_taken = 0;
    };
    std::vector<watched> boats_;
};

/// The number of alarms that are not acknowledged, and the most severe of them; null: none. Points into `seen`.
struct open_alarm_count {
    std::size_t count = 0;
    const alarm_entry* worst = nullptr;
};
open_alarm_count count_open(const snapshot& seen) noexcept;

} // namespace atirma::console
