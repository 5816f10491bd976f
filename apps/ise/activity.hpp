#pragma once
#include "json.hpp"
#include "survey.hpp"

#include <optional>
#include <string>
#include <variant>
#include <vector>

namespace ise::cli {

/// Why something was refused or not sent, since the component began and meanwhile.
struct loss_count {
    std::uint64_t ever = 0, now = 0;
};

/// A service at work between two looks at its component. Times are the ends of their buckets: up to a quarter too long.
struct service_activity {
    std::string name;
    bool publishes = false;                                  ///< else it answers calls
    double hz = 0;                                           ///< calls that a handler began with, or packets
    std::uint64_t running = 0, waiting = 0, subscribers = 0; ///< now
    std::optional<duration> handled_p50, handled_p99, waited_p50, waited_p99; ///< nothing: no call meanwhile
    json_object<loss_count> losses;                                           ///< by reason

    bool loses() const noexcept;
    /// Whether there is anything to tell.
    bool at_work() const noexcept { return hz > 0 || running > 0 || waiting > 0 || loses(); }

    struct published {
        std::string name, kind = "subscription";
        double hz = 0;
        std::uint64_t waiting = 0, subscribers = 0;
        json_object<loss_count> not_sent;
    };
    struct answered {
        std::string name, kind = "request-response";
        double hz = 0;
        std::uint64_t waiting = 0, running = 0;
        std::optional<duration> handled_p50_s, handled_p99_s, waited_p50_s, waited_p99_s;
        json_object<loss_count> refused;
    };
    /// What there is of its kind.
    std::variant<answered, published> json() const;
};

/// By how much a counter grew; none where it began anew.
std::uint64_t grown(std::uint64_t now, std::uint64_t before);

/// Those that both have, ISE's own apart. `seconds` lie between.
std::vector<service_activity> service_activities(const health_report& before, const health_report& now, double seconds);

/// The time that `part` of them did not exceed, of those that came between; nothing where none came.
std::optional<duration> percentile(const std::vector<duration_count>& before, const std::vector<duration_count>& now,
                                   double part);

/// What a component did between two looks at it: what `ise top --json` prints.
struct activity {
    std::string path, state, host;
    bool answered = true;
    std::uint64_t sessions = 0; ///< those of commands that only look apart
    std::optional<double> calls_hz, packets_hz;
    std::optional<double> in_bytes_per_s, out_bytes_per_s; ///< null: it was not seen twice in the same life
    std::optional<std::uint64_t> running;                  ///< handlers, now; null: it has no health service
    std::optional<std::uint64_t> unsent_bytes;             ///< now
    std::uint64_t dropped_too_slow = 0;                    ///< by slow subscribers, ever
    std::optional<std::uint64_t> dropped_too_slow_now;     ///< meanwhile
    std::optional<std::uint64_t> calls_refused;            ///< expired, unknown, mismatched or beyond a limit, ever
    std::optional<std::uint64_t> calls_refused_now;        ///< meanwhile
    std::optional<duration> round_trip_s;                  ///< the longest of its sessions; null: none was measured
    std::vector<service_activity> services;                ///< it was seen twice in the same life
};

/// By path. A component that was restarted in between has no rates yet.
std::vector<activity> activities(const std::vector<surveyed>& before, const std::vector<surveyed>& now);

} // namespace ise::cli
