#pragma once
#include "service_activity.hpp"
#include "surveyed.hpp"

#include <optional>
#include <string>
#include <vector>

namespace ise::cli {

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
