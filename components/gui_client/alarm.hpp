#pragma once
#include <components/boat/telemetry.hpp>

#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace atirma::console {

enum class severity : std::uint8_t { notice, warning, critical };
/// "notice", "warning", "critical".
std::string_view name_of(severity how) noexcept;

/// The limits beyond which an alarm is raised.
struct alarm_limits {
    double no_data_s = 60; ///< nothing received over any link; five telemetry periods if that is longer
    /// Nothing received over one link that worked before; five telemetry periods if that is longer.
    double link_silent_s = 60;
    double proxy_lost_s = 5;
    unsigned battery_low_percent = 20;
    unsigned battery_critical_percent = 10;
    double off_track_m = 60;
    int modem_hot_c = 60;       ///< the modem then limits its duty cycle
    unsigned duty_percent = 90; ///< of what is allowed
    bool operator==(const alarm_limits&) const = default;
};

/// An alarm that was acknowledged before the console was restarted.
struct acknowledged_alarm {
    std::string key;
    severity how = severity::warning;
    bool operator==(const acknowledged_alarm&) const = default;
};

/// An alarm stays until its cause is gone and it has been acknowledged.
struct alarm_entry {
    std::string key; ///< "battery", "link:atirma/shore/xbee"
    severity how = severity::warning;
    std::string text;
    utc_time raised_at{};
    std::optional<utc_time> over_at; ///< its cause is gone
    bool acknowledged = false;
};

enum class alarm_change : std::uint8_t { raised, more_severe, over, acknowledged };
/// "raised", "more severe"…
std::string_view name_of(alarm_change what) noexcept;

/// A line of the log of alarms.
struct alarm_event {
    std::uint64_t number = 0; ///< counts from 1
    utc_time at{};
    alarm_change what = alarm_change::raised;
    severity how = severity::warning;
    std::string key;
    std::string text;
};

/// The alarms: raised and cleared by rules, acknowledged by people. Pure, bounded.
class alarm_book {
public:
    static constexpr std::size_t max_alarms = 64;
    static constexpr std::size_t max_events = 500;

    /// Raises an alarm or updates its text. If it was over, or becomes more severe, it must be acknowledged again.
    void raise(const std::string& key, severity how, std::string text, utc_time now);
    /// The cause is gone: removes the alarm if it was acknowledged; else it waits for that.
    void clear(const std::string& key, utc_time now);
    /// `raise` or `clear`.
    void set(const std::string& key, bool there, severity how, const std::string& text, utc_time now);
    /// Reports a single event: it is over at once, and waits to be acknowledged.
    void tell(const std::string& key, severity how, std::string text, utc_time now);
    /// Empty: all. Returns whether there was one.
    bool acknowledge(const std::string& key, utc_time now = utc_time());
    /// Alarms that were acknowledged before a restart: if one is raised again before `until`, and is not more severe
    /// than then, it counts as acknowledged. At most max_alarms.
    void remember(const std::vector<acknowledged_alarm>& before, utc_time until);

    const alarm_entry* find(const std::string& key) const;
    /// Sorted: unacknowledged first, then by severity, then the newest.
    std::vector<alarm_entry> list() const;
    /// The number of alarms that were discarded because there were too many.
    std::uint64_t dropped() const noexcept { return dropped_; }
    /// What happened to them, oldest first; at most max_events. The same object until something happens.
    std::shared_ptr<const std::vector<alarm_event>> log() const;
    std::uint64_t last_event() const noexcept { return events_.empty() ? 0 : events_.back().number; }

private:
    void note(alarm_change what, const alarm_entry& of, utc_time now);

    std::map<std::string, alarm_entry> alarms_;
    std::map<std::string, severity> remembered_;
    utc_time remembered_until_{};
    std::uint64_t dropped_ = 0;
    std::deque<alarm_event> events_;
    mutable std::shared_ptr<const std::vector<alarm_event>> shared_log_;
};

} // namespace atirma::console
