#pragma once
#include <ise/component/health.hpp>

#include <optional>
#include <string>
#include <vector>

namespace ise::cli {

/// A service at work between two looks at its component. Times are the ends of their buckets: up to a quarter too long.
struct service_activity {
    /// Why something was refused or not sent, since the component began and meanwhile.
    struct loss {
        std::string reason;
        std::uint64_t ever = 0;
        std::uint64_t meanwhile = 0;
    };

    std::string name;
    bool publishes = false;                                  ///< else it answers calls
    double hz = 0;                                           ///< calls that a handler began with, or packets
    std::uint64_t running = 0, waiting = 0, subscribers = 0; ///< now
    std::optional<duration> handled_p50, handled_p99, waited_p50, waited_p99; ///< nothing: no call meanwhile
    std::vector<loss> losses;

    bool loses() const noexcept;
    /// Whether there is anything to tell.
    bool at_work() const noexcept { return hz > 0 || running > 0 || waiting > 0 || loses(); }
};

/// By how much a counter grew; none where it began anew.
std::uint64_t grown(std::uint64_t now, std::uint64_t before);

/// Those that both have, ISE's own apart. `seconds` lie between.
std::vector<service_activity> service_activities(const health_report& before, const health_report& now, double seconds);

/// The time that `part` of them did not exceed, of those that came between; nothing where none came.
std::optional<duration> percentile(const std::vector<duration_count>& before, const std::vector<duration_count>& now,
                                   double part);

} // namespace ise::cli
