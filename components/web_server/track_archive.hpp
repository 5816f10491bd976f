#pragma once
#include <components/boat/communication.hpp>
#include <components/web_server/archive_options.hpp>
#include <components/web_server/track_line.hpp>

#include <ise/core/result.hpp>
#include <ise/database/database.hpp>

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace atirma {

/// A fix as it lies on disk.
struct archived_fix {
    track_point point; ///< without `source` and `revision`
    std::string link;
};

/// The tracks and the telemetry of the boats on disk (SQLite), so that a restart of the page loses nothing.
///
/// What is given to `keep` waits in memory until `commit` writes it, all or nothing. A disk that is full costs nothing
/// but what `archive_statistics` tells: the page goes on, and what waits is written when there is room. Each call
/// blocks for as long as the disk takes. Not thread-safe.
///
/// A damaged file is set aside as `how` says, and an empty one takes its place (`archive_statistics::begun_anew`): what
/// waits is written there, and everything else is to be given to `keep` once more.
class track_archive {
public:
    /// Errors: io_failed (with the file and SQLite's words), malformed (damaged, only without `how`), invalid_argument
    /// (written by a newer program).
    static ise::result<std::unique_ptr<track_archive>> open(const archive_options& options,
                                                            ise::when_damaged how = ise::when_damaged());
    ~track_archive();

    /// Once for each boat before anything else of it.
    ise::result<void> enter(const std::string& boat, const std::string& name);
    void keep(const std::string& boat, const track_point& point, const std::string& link);
    void keep(const std::string& boat, const telemetry_packet& packet, std::string_view kind);
    /// A link that was heard then, as somebody else tells.
    void keep_heard(const std::string& boat, const std::string& link, utc_ms at);
    /// How far a provider was followed (`telemetry_follower::seen`), and what the page says of the whole voyage:
    /// written with what was kept before, and never ahead of it.
    void keep_cursor(const std::string& boat, const std::string& feed, const track_cursor& seen);
    void keep_trip(const std::string& boat, double sailed_m);

    /// Writes what waits; then a slice of what is too old goes. Errors: io_failed; everything goes on waiting.
    ise::result<void> commit(utc_ms now);

    /// Fixes in the order of time, `from` <= at < `until`, at most about `max`: of more, evenly spaced ones.
    /// What waits is not among them. Errors of this and of all below: io_failed.
    ise::result<std::vector<archived_fix>> fixes(const std::string& boat, utc_ms from, utc_ms until, std::size_t max);
    /// Packets in the order of measurement, `from` <= measured_at < `until`; at most `max`.
    ise::result<std::vector<telemetry_packet>> telemetry(const std::string& boat, utc_ms from, utc_ms until,
                                                         std::size_t max);
    /// The newest packets of each kind, oldest first: what the page shows comes from these.
    ise::result<std::vector<telemetry_packet>> newest(const std::string& boat);
    ise::result<track_cursor> cursor(const std::string& boat, const std::string& feed);
    ise::result<double> sailed_m(const std::string& boat);
    /// When each link was heard last.
    ise::result<std::map<std::string, utc_ms>> heard(const std::string& boat);

    const archive_statistics& statistics() const noexcept;

    utc_ms downloads_rest_until{}; ///< those of all boats that use this archive (downloads.hpp)

private:
    struct implementation;
    explicit track_archive(std::unique_ptr<implementation> opened);
    std::unique_ptr<implementation> self_;
};

} // namespace atirma
