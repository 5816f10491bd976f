#pragma once
#include <components/gui_client/view.hpp>

#include <memory>
#include <string>
#include <vector>

namespace atirma::console {

/// The boat's track in bounded memory, in the order in which it was sailed, whatever the order in which it was told.
/// When it is full the older half keeps every second point. Pure.
class track_store {
public:
    explicit track_store(std::size_t most = 20000) : most_(most < 4 ? 4 : most) {}

    /// A point of a time that is there already is left out.
    void add(track_point point);
    void clear();
    std::size_t size() const noexcept { return points_.size(); }
    /// The same object until something changes.
    std::shared_ptr<const std::vector<track_point>> points();
    /// What the track takes now, `points()` included: at most 3 · `most` points, as a full vector doubles.
    std::size_t bytes() const noexcept;

private:
    void thin();

    std::size_t most_;
    std::vector<track_point> points_;
    std::shared_ptr<const std::vector<track_point>> shared_;
};

/// `time,latitude_deg,longitude_deg,speed_mps,link,history,boot`, one line a point.
std::string track_to_csv(const std::vector<track_point>& track);
/// GPX 1.1: the waypoints as a route, the track in segments that end where nothing was told for ten minutes.
std::string track_to_gpx(const std::string& boat, const std::vector<track_point>& track,
                         const std::vector<waypoint>& waypoints);
/// "2026-11-21T17:30:05.250Z".
std::string iso_time(utc_time at);

} // namespace atirma::console
