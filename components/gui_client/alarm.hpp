#pragma once
#include <components/boat/telemetry.hpp>

#include <map>
#include <optional>
#include <string>
#include <vector>

namespace atirma::console {

enum class severity : std::uint8_t { notice, warning, critical };

/// When the operator is called.
struct alarm_limits {
    double no_data_s = 60;     ///< nothing heard over any link; five periods where the boat tells more rarely
    double link_silent_s = 60; ///< nothing over a link that was heard before; five periods if that is longer
    double proxy_lost_s = 5;
    unsigned battery_low_percent = 20;
    unsigned battery_critical_percent = 10;
    double off_track_m = 60;
    int modem_hot_c = 60;       ///< the modem then holds its duty cycle over a second
    unsigned duty_percent = 90; ///< of what is allowed
    bool operator==(const alarm_limits&) const = default;
};

/// An alarm that was acknowledged before the console was started again.
struct acknowledged_alarm {
    std::string key;
    severity how = severity::warning;
    bool operator==(const acknowledged_alarm&) const = default;
};

/// Something that the operator must see. It stays until it is over *and* was acknowledged.
struct alarm_entry {
    std::string key; ///< "battery", "link:atirma/shore/xbee"
    severity how = severity::warning;
    std::string text;
    utc_time raised_at{};
    std::optional<utc_time> over_at; ///< its cause is gone
    bool acknowledged = false;
};

/// The alarms: raised and cleared by rules, acknowledged by people. Pure, bounded.
class alarm_book {
public:
    static constexpr std::size_t max_alarms = 64;

    /// A cause is there: raises it, or brings its text up to date. One that was over, or has become graver, is to be
    /// acknowledged again.
    void raise(const std::string& key, severity how, std::string text, utc_time now);
    /// The cause is gone. What was acknowledged goes; the rest waits for its acknowledgement.
    void clear(const std::string& key, utc_time now);
    /// `raise` or `clear`.
    void set(const std::string& key, bool there, severity how, const std::string& text, utc_time now);
    /// Something that happened once: it is over at once, and waits to be acknowledged.
    void tell(const std::string& key, severity how, std::string text, utc_time now);
    /// Empty: all. True if there was such a one.
    bool acknowledge(const std::string& key);
    /// These were acknowledged in another life of the console: one that is raised before `until`, and is no graver
    /// than it was then, does not call again. At most max_alarms.
    void remember(const std::vector<acknowledged_alarm>& before, utc_time until);

    const alarm_entry* find(const std::string& key) const;
    /// To be acknowledged first, then the gravest, then the newest.
    std::vector<alarm_entry> list() const;
    /// That were not kept since there are too many.
    std::uint64_t dropped() const noexcept { return dropped_; }

private:
    std::map<std::string, alarm_entry> alarms_;
    std::map<std::string, severity> remembered_;
    utc_time remembered_until_{};
    std::uint64_t dropped_ = 0;
};

} // namespace atirma::console
