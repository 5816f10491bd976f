#pragma once
#include "survey.hpp"

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

/// What a component did between two looks at it.
struct activity {
    std::string path, state, host;
    std::size_t sessions = 0;                                    ///< those of commands that only look apart
    std::optional<double> calls_hz, packets_hz, in_bps, out_bps; ///< nothing: it was not seen twice in the same life
    std::optional<std::uint64_t> dropped, refused;               ///< meanwhile
    std::uint64_t dropped_ever = 0;                              ///< by slow subscribers
    std::uint64_t refused_ever = 0;         ///< calls: expired, unknown, mismatched or beyond a limit
    std::uint64_t running = 0;              ///< handlers, now
    std::uint64_t unsent_bytes = 0;         ///< now
    duration round_trip{};                  ///< the longest of its sessions; zero: none was measured
    std::vector<service_activity> services; ///< it was seen twice in the same life
    bool answered = true;
    bool has_health = false; ///< else it tells no refusals, handlers and queues
};

/// By path. A component that was restarted in between has no rates yet.
std::vector<activity> activities(const std::vector<surveyed>& before, const std::vector<surveyed>& now);

} // namespace ise::cli
