#pragma once
#include <components/web_server/track_updates.hpp>

#include <chrono>
#include <cstdint>
#include <optional>
#include <vector>

namespace atirma {

/// Great-circle distance on a sphere of the earth's mean radius.
double distance_m(double from_latitude_deg, double from_longitude_deg, double to_latitude_deg,
                  double to_longitude_deg) noexcept;
/// Initial bearing of that great circle, 0 <= x < 360.
double bearing_deg(double from_latitude_deg, double from_longitude_deg, double to_latitude_deg,
                   double to_longitude_deg) noexcept;

/// One fix of the track, with what was known beside it.
struct track_point {
    utc_ms at;
    double latitude_deg = 0;
    double longitude_deg = 0;
    std::optional<double> speed_mps, course_deg, heading_deg, heel_deg, wind_speed_mps, wind_direction_deg,
        circular_error_m;
    std::uint32_t source = 0;   ///< index into the state's list of links
    std::uint64_t revision = 0; ///< of the state when it was added or last changed
    double sailed_m = 0;        ///< along the track up to here; thinning does not change it
    /// The longest time without a fix since the point before: an outage stays one when the points beside it are
    /// thinned.
    std::chrono::milliseconds silence{0};
};

struct track_limits {
    std::size_t max_points = 3000;
    std::chrono::milliseconds spacing{1000}; ///< fixes nearer in time to a neighbour are left out
    double noise_m = 4;                      ///< smaller moves are not counted as sailed
    double rough_fix_m = 200;                ///< a fix with a larger circular error is shown, but not counted as sailed
};

/// The boat's track in the order of time, whatever order its fixes arrive in, in bounded memory: when it is full,
/// its older three quarters are thinned by taking out what changes the line's shape and timing least.
class track_line {
public:
    explicit track_line(track_limits limits = track_limits()) : limits_(limits) {}

    /// The place where it was put; nothing if there is a point at (almost) that time already.
    const track_point* insert(track_point point);
    /// Gives the point that is nearest to `at`, within `tolerance`, a wind if it has none.
    const track_point* annotate_wind(utc_ms at, double speed_mps, std::optional<double> direction_deg,
                                     std::uint64_t revision, std::chrono::milliseconds tolerance);

    /// Makes the way that long: of a track that was kept with fewer points than were sailed.
    void correct_sailed(double total_m) noexcept;

    const std::vector<track_point>& points() const noexcept { return points_; }
    double sailed_m() const noexcept { return points_.empty() ? 0 : points_.back().sailed_m; }
    std::uint64_t thinned_points() const noexcept { return thinned_; }
    /// The last point at or before `at`; null if there is none.
    const track_point* before(utc_ms at) const noexcept;

private:
    void append(track_point point);
    void thin();

    track_limits limits_;
    std::vector<track_point> points_;
    std::optional<track_point> counted_from_; ///< the last place from which a move was counted
    std::uint64_t thinned_ = 0;
};

} // namespace atirma
