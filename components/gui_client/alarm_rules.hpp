#pragma once
#include <components/gui_client/alarm.hpp>
#include <components/gui_client/view.hpp>

#include <map>
#include <string>

namespace atirma::console {

/// What the rules of the alarms look at.
struct alarm_causes {
    const alarm_limits& limits;
    const finding_view& finding;
    const boat_view& boat;
    const std::map<std::string, link_view>& links; ///< by path
    const std::map<std::string, node_view>& nodes; ///< by path
};

/// Raises and clears the alarms whose causes last for some time. Pure.
void apply_alarm_rules(alarm_book& alarms, const alarm_causes& causes, utc_time now);

} // namespace atirma::console
