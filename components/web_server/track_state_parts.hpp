#pragma once
#include <components/boat/report_rhythm.hpp>
#include <components/web_server/track_json.hpp>
#include <components/web_server/track_options.hpp>
#include <components/web_server/track_updates.hpp>
#include <ise/http/sse_event.hpp>

#include <fmt/format.h>

#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

/// What track_state keeps; for its own files only.
namespace atirma {

constexpr std::size_t max_track_text = 64;
constexpr std::size_t max_track_sources = 16;
/// How far apart in time a fix and a wind may be to belong together.
constexpr std::chrono::seconds match_window{60};

/// Values of a quantity in the order of time: of more, the older half keeps every other one.
constexpr std::size_t max_history = 1000;
using quantity_history = std::vector<std::pair<utc_ms, double>>;

inline std::string bounded(std::string_view text) { return std::string(text.substr(0, max_track_text)); }

struct track_state_parts {
    explicit track_state_parts(track_options chosen) : options(std::move(chosen)), line(options.track) {}

    track_options options;
    track_line line;
    track_statistics statistics;
    std::uint64_t revision = 0;
    std::optional<position_update> position;
    std::optional<navigation_update> navigation;
    std::optional<wind_update> wind;
    std::optional<power_update> power;
    std::optional<waypoints_update> waypoints;
    std::optional<mode_update> mode;
    std::optional<utc_ms> leg_since; ///< when the active waypoint became it
    std::vector<std::string> sources;
    std::map<std::string, feed_update, std::less<>> feeds;
    std::map<std::string, utc_ms, std::less<>> heard;               ///< last live report by link
    std::map<std::string, signal_update, std::less<>> signals;      ///< by link
    std::map<std::string, quantity_history, std::less<>> histories; ///< of what is not reported with positions
    report_rhythm rhythm;

    std::string id() const { return fmt::format("{}:{}", options.epoch, revision); }

    template <class Update>
    bool is_newer(const std::optional<Update>& current, const Update& update) {
        if (!current || update.from.measured_at > current->from.measured_at) return true;
        if (update.from.measured_at < current->from.measured_at) ++statistics.out_of_order;
        return false;
    }

    /// False (and counted) where the report cannot be used at all; otherwise its time and link are made sane.
    bool accept(report_origin& from, utc_ms now);
    void note_heard(const std::string& source, utc_ms at, utc_ms now);
    /// Where the gateway believed the boat to be says less than a fix of the boat's own that is not stale yet.
    bool would_blur(const position_update& update) const;
    std::uint32_t source_index(const std::string& source);
    std::optional<ise::sse_event> event(utc_ms now, json state, const track_point* point = nullptr) const;
    json trip() const;
    /// The waypoint steered for, as seen from the newest position.
    json next_waypoint() const;
    /// How fast the waypoint comes nearer. A boat that tacks does not point at it, so this is made good over the
    /// last minutes of the leg; at its beginning, the speed's part in that direction.
    std::optional<double> closing_mps(const track_waypoint& target, double there_m) const;
    void set_active(std::optional<std::size_t> active, utc_ms at);
    void remember(const std::string& quantity, utc_ms at, std::optional<double> value);
    json state_json() const;
    json signals_json() const;
    /// By link and kind of value: up to which age in seconds it is fresh, and from which on stale.
    json freshness_json() const;
    json feeds_json() const;
    json heard_json() const;
};

} // namespace atirma
