#pragma once
#include <components/boat/duplicate_filter.hpp>
#include <components/boat/services.hpp>
#include <components/web_server/track_state.hpp>

#include <functional>
#include <map>
#include <vector>

namespace atirma {

struct feed_statistics {
    std::uint64_t received = 0;
    std::uint64_t duplicates = 0; ///< of a packet that came over another link before
    std::uint64_t malformed = 0;
    std::map<std::string, std::uint64_t> by_type; ///< "location" → 12
};

/// Telemetry packets of any number of links into what the page shows. Pure: times are passed in.
class telemetry_feed {
public:
    explicit telemetry_feed(track_state& into) : state_(into) {}

    /// Events to publish, in order.
    std::vector<ise::sse_event> take(const telemetry_packet& packet, utc_ms now);

    /// What was kept over a restart of the page: shows it, and counts nothing.
    void restore(const telemetry_packet& packet, utc_ms now);

    /// What was shown is new once more for `on_new`, as after a restart.
    void begin_anew() { seen_ = duplicate_filter(); }

    const feed_statistics& statistics() const noexcept { return statistics_; }

    /// Told of each packet that is new, and its kind, after the state has taken it; may be empty.
    std::function<void(const telemetry_packet&, std::string_view kind)> on_new;

private:
    std::vector<ise::sse_event> show(const telemetry_packet& packet, const telemetry_message& message, utc_ms now);
    std::optional<ise::sse_event> waypoints_part(const report_origin& from, const waypoints& part, utc_ms now);

    track_state& state_;
    duplicate_filter seen_;
    feed_statistics statistics_;
    // A long list comes in parts; parts of two revisions do not mix.
    std::uint16_t boot_ = 0, revision_ = 0;
    utc_time configured_at_{};
    std::map<std::size_t, waypoint> parts_;
};

} // namespace atirma
