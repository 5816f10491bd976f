#pragma once
#include <components/boat/packet_header.hpp>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace atirma {

/// A telecommand that was given at a console's window, as the window's list showed it.
struct shown_command {
    std::uint32_t id = 0;
    utc_time given{};
    std::optional<utc_time> ended;
    std::string what, phase, words; ///< phase: "done", "refused", "failed", "expired", "late", else it is open
    bool accepted = false;          ///< it was seen in a state that follows from the word of a node
    bool is_done() const { return phase == "done"; }
    bool is_refused() const { return (phase == "refused" || phase == "failed") && !words.empty(); }
    bool is_expired() const { return phase == "expired" || phase == "late"; }
    bool has_ended() const { return is_done() || is_refused() || is_expired(); }
};

/// The deeds of an operator at a console's window, and the state of the window at the end. The window's process writes
/// it as JSON, and the mission reads it.
struct window_view {
    std::string name;
    bool left = false;                    ///< its process ended as it was asked to
    std::string status, place;            ///< of the boat, as the head and the chart have them
    bool fix = false;                     ///< the chart has the boat's position
    std::uint64_t clicks = 0, keys = 0;   ///< by the operator
    std::uint64_t track = 0, packets = 0; ///< points drawn; packets shown
    std::uint64_t given = 0;              ///< telecommands that the console accepted from the window
    std::vector<shown_command> commands;  ///< by the list, in the order of its ids
    std::int64_t longest_stall_ms = 0;    ///< that no event was handled
    utc_time stalled_at{};
};

} // namespace atirma
