#pragma once
#include <components/boat/report_rhythm.hpp>
#include <components/web_server/track_line.hpp>
#include <components/web_server/track_options.hpp>
#include <components/web_server/track_updates.hpp>
#include <ise/http/sse_event.hpp>

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

namespace atirma {

struct track_state_parts;

/// What the page knows of the boat: the newest report of each kind, and the whole track in bounded memory.
/// Pure: no clock, no I/O, one thread. Times are passed in.
///
/// The newest measurement wins, whatever order reports arrive in: an older one (history, or a slower link) fills the
/// track and never moves the current position backwards; a rough fix is the current position only where no other is
/// known that is fresh. Each `apply` returns the event to publish, or nothing where the page would not change. Clients
/// that hand back an event's id get only what came later.
class track_state {
public:
    explicit track_state(track_options options = track_options());
    ~track_state();
    track_state(track_state&&) noexcept;
    track_state& operator=(track_state&&) noexcept;

    std::optional<ise::sse_event> apply(const position_update& update, utc_ms now);
    std::optional<ise::sse_event> apply(const navigation_update& update, utc_ms now);
    std::optional<ise::sse_event> apply(const wind_update& update, utc_ms now);
    std::optional<ise::sse_event> apply(const power_update& update, utc_ms now);
    std::optional<ise::sse_event> apply(const waypoints_update& update, utc_ms now);
    std::optional<ise::sse_event> apply(const mode_update& update, utc_ms now);
    std::optional<ise::sse_event> apply(const signal_update& update, utc_ms now);
    std::optional<ise::sse_event> apply(const feed_update& update, utc_ms now);

    /// How often the boat reports, as it tells and as it does: the page's rule of freshness follows it.
    void on_report(link_id link, utc_ms measured_at) noexcept;
    void on_configuration(const configuration& result) noexcept;
    /// Of the newest position's link.
    freshness_limits position_limits() const noexcept;
    const report_rhythm& rhythm() const noexcept; ///< until the state changes

    /// The newest report of each kind as JSON, without the track: what a page shows first. `track_id` is that of the
    /// `track_text` which the page gets besides: its stream goes on from there. `more` is a JSON object's members,
    /// each followed by a comma; may be empty.
    std::string newest_text(utc_ms now, std::string_view track_id, std::string_view more = {}) const;
    /// The whole track and the histories of other quantities as JSON: column by column, each value as the difference
    /// from the one before (README.md).
    std::string track_text() const;
    /// What `snapshot` and events have as their id now.
    std::string id() const;

    /// Everything, for a new client; only the track points since `last_event_id` where that is an id of this epoch.
    ise::sse_event snapshot(utc_ms now, std::string_view last_event_id = {}) const;
    /// The server is alive and this is its time. To be published every `status_period`.
    ise::sse_event status(utc_ms now) const;

    // What was kept over a restart of the server; before anything is applied. No events are made.
    void restore(track_point fix, const std::string& link);
    void restore_heard(const std::string& link, utc_ms at, utc_ms now);
    void restore_sailed(double total_m);

    /// Told of each fix that comes into the track, or changes there, and its link. Nobody by default.
    std::function<void(const track_point&, const std::string& link)> on_point;

    const std::vector<track_point>& track() const noexcept;
    /// The names of links that `track_point::source` counts.
    const std::vector<std::string>& sources() const noexcept;
    const std::vector<track_waypoint>& waypoints() const noexcept;
    double sailed_m() const noexcept;
    /// The newest position; nothing before the first.
    const std::optional<position_update>& position() const noexcept;
    const track_options& options() const noexcept;
    const track_statistics& statistics() const noexcept;

private:
    std::unique_ptr<track_state_parts> self_;
};

} // namespace atirma
