#pragma once
#include <components/gui_client/alarm.hpp>

#include <chrono>
#include <map>
#include <string>
#include <vector>

namespace atirma::console {

/// When the console calls the operator: at once for each alarm that is raised or becomes more severe, and again until
/// it is acknowledged: critical ones every 5 s, warnings every 30 s. Notices are quiet: they call once. Pure.
class alarm_bell {
public:
    static constexpr std::chrono::seconds critical_period{5}, warning_period{30};

    /// The alarm that calls now, the most severe one; null: none. Points into `alarms`.
    const alarm_entry* update(const std::vector<alarm_entry>& alarms, utc_time now);

private:
    struct call {
        severity how;
        utc_time raised_at, last;
    };
    std::map<std::string, call> calls_; ///< by key; of unacknowledged alarms
};

} // namespace atirma::console
