#include <components/gui_client/fleet_watch.hpp>

#include <components/gui_client/operator_port.hpp>

#include <algorithm>
#include <stdexcept>
#include <tuple>
#include <utility>

namespace atirma::console {

fleet_watch::fleet_watch(std::vector<std::string> names) {
    if (names.empty()) throw std::invalid_argument("a fleet has at least one boat");
    auto nothing = operator_port().latest();
    for (auto& name : names) boats_.push_back({std::move(name), nothing, {}});
}

void fleet_watch::take(std::size_t boat, std::shared_ptr<const snapshot> seen) {
    if (seen) boats_.at(boat).seen = std::move(seen);
}

std::optional<std::size_t> fleet_watch::first_ended(std::size_t shown) const {
    if (!ended(shown).empty()) return shown;
    auto first = std::ranges::find_if(boats_, [](const watched& one) { return !one.ended.empty(); });
    if (first == boats_.end()) return std::nullopt;
    return static_cast<std::size_t>(first - boats_.begin());
}

std::optional<fleet_call> fleet_watch::next_call() {
    std::optional<fleet_call> made;
    for (std::size_t place = 0; place < boats_.size(); ++place) {
        auto& boat = boats_[place];
        const auto& bell = boat.seen->bell;
        // A count that went back to 0: its component has started again.
        if (std::exchange(boat.calls_heard, bell.count) == bell.count || bell.count == 0) continue;
        if (!made || bell.how > made->how) made = fleet_call{place, bell.how, bell.text};
    }
    return made;
}

std::vector<fleet_event> fleet_watch::take_events() {
    std::vector<fleet_event> made;
    for (std::size_t place = 0; place < boats_.size(); ++place) {
        auto& boat = boats_[place];
        const auto& log = boat.seen->alarm_log;
        if (!log || log->empty()) continue;
        if (log->back().number < boat.events_taken) boat.events_taken = 0; // its component has started again
        for (const auto& one : *log)
            if (one.number > boat.events_taken) made.push_back({place, one});
        boat.events_taken = log->back().number;
    }
    std::ranges::stable_sort(made, {}, [](const fleet_event& one) { return one.event.at; });
    return made;
}

std::vector<fleet_alarm> fleet_watch::open_alarms(std::size_t shown) const {
    std::vector<fleet_alarm> made;
    for (std::size_t place = 0; place < boats_.size(); ++place)
        for (const auto& one : boats_[place].seen->alarms)
            if (!one.acknowledged && boats_[place].ended.empty()) made.push_back({place, one});
    std::ranges::stable_sort(made, [shown](const fleet_alarm& a, const fleet_alarm& b) {
        return std::tuple(b.alarm.how, a.boat != shown, b.alarm.raised_at) <
               std::tuple(a.alarm.how, b.boat != shown, a.alarm.raised_at);
    });
    return made;
}

std::string fleet_watch::labelled(std::size_t boat, const std::string& text) const {
    return boats_.size() == 1 ? text : name(boat) + ": " + text;
}

open_alarm_count count_open(const snapshot& seen) noexcept {
    open_alarm_count made;
    for (const auto& one : seen.alarms) {
        if (one.acknowledged) continue;
        ++made.count;
        if (!made.worst || one.how > made.worst->how) made.worst = &one;
    }
    return made;
}

} // namespace atirma::console
