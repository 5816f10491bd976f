#pragma once
#include <components/boat/heard.hpp>
#include <components/boat/telemetry.hpp>

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

namespace atirma {

/// Kinds of values that the boat reports at different rates.
enum class value_kind : std::uint8_t { position, sailing, breeze, supply, settings, waypoints, links };

/// Until when a value counts as current, by its age in seconds. The tracking page and the console have no other rule.
struct freshness_limits {
    double fresh_s = 0; ///< up to this age a value is fresh
    double stale_s = 0; ///< from this age on it is stale ("no current data"); in between it is ageing
    bool operator==(const freshness_limits&) const = default;
};

/// Fresh for two periods (at least 6 s), stale after three (at least 30 s): one report may be lost, and another one
/// late, before anything is said; a loss shows within three periods.
freshness_limits limits_of(double period_s) noexcept;

/// How often the boat reports a value of that kind, if it reports its position every `position_s`.
double period_of(value_kind kind, double position_s) noexcept;

/// The pace of the boat's position reports over each link: the period that its configuration names, or, as long as
/// none is known, the one that was seen, or the usual one. A pace that is seen to be slower than the configuration is
/// believed: over Iridium the boat does not send its configuration. Pure: times are passed in.
class report_rhythm {
public:
    /// A position report that is no history, in any order.
    void on_report(link_id link, utc_time measured_at) noexcept;
    void on_configuration(const configuration& result) noexcept;

    /// Seconds between two position reports.
    double position_s(link_id link) const noexcept;
    freshness_limits limits(value_kind kind, link_id link) const noexcept {
        return limits_of(period_of(kind, position_s(link)));
    }
    /// Seconds from which on the silence between a position and the next is an outage on maps and in exported tracks:
    /// as long as a position takes to become stale over either link, and at least three minutes.
    double outage_s(link_id before, link_id after) const noexcept;

private:
    static constexpr std::size_t kept = 5; // intervals: their median outlives a gap, and a report on request
    struct pace_of_link {
        double told_s = 0; ///< 0: not known, or off
        std::optional<utc_time> last;
        std::array<double, kept> seen_s{};
        std::size_t seen = 0; ///< counts on; the last `kept` are kept
    };
    std::array<pace_of_link, link_count> links_;
};

} // namespace atirma
