#include <components/gui_client/alarm_bell.hpp>

#include <utility>

namespace atirma::console {

const alarm_entry* alarm_bell::update(const std::vector<alarm_entry>& alarms, utc_time now) {
    auto before = std::exchange(calls_, {});
    const alarm_entry* first = nullptr;
    for (const auto& one : alarms) {
        if (one.acknowledged) continue;
        auto known = before.find(one.key);
        bool fresh = known == before.end() || known->second.how < one.how || known->second.raised_at != one.raised_at;
        auto period = one.how == severity::critical ? critical_period : warning_period;
        bool again = !fresh && one.how != severity::notice && now - known->second.last >= period;
        bool calls = fresh || again || (known != before.end() && now < known->second.last); // the clock was set back
        calls_[one.key] = {one.how, one.raised_at, calls ? now : known->second.last};
        if (calls && (!first || one.how > first->how)) first = &one;
    }
    return first;
}

} // namespace atirma::console
