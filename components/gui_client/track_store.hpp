#pragma once
#include <components/gui_client/view.hpp>

#include <memory>
#include <string>
#include <vector>

namespace atirma::console {

/// The boat's track in bounded memory, in the order of the measurements, whatever the order of arrival. When it is
/// full, the older half keeps every second point. Pure.
class track_store {
public:
    explicit track_store(std::size_t most = 20000) : most_(most < 4 ? 4 : most) {}

    /// A point with the time of an existing one is ignored.
    void add(track_point point);
    void clear();
    std::size_t size() const noexcept { return points_.size(); }
    /// The same object until something changes.
    std::shared_ptr<const std::vector<track_point>> points();
    /// The memory of the track, `points()` included: at most 3 · `most` points, as a full vector doubles.
    std::size_t bytes() const noexcept;

private:
    void thin();

    std::size_t most_;
    std::vector<track_point> points_;
    std::shared_ptr<const std::vector<track_point>> shared_;
};

/// `time,latitude_deg,longitude_deg,speed_mps,link,history,boot`, one line a point.
std::string track_to_csv(const std::vector<track_point>& track);
/// Whether the boat was not heard between a point and the one before it.
bool is_outage(const track_point& before, const track_point& point, const report_rhythm& rhythm) noexcept;
/// GPX 1.1: the waypoints as a route, the track in segments, which end at outages.
std::string track_to_gpx(const std::string& boat, const std::vector<track_point>& track,
                         const std::vector<waypoint>& waypoints, const report_rhythm& rhythm);

} // namespace atirma::console
