#include <components/gui_client/track_store.hpp>

#include <components/gui_client/freshness.hpp>

#include <ise/core/time_text.hpp>

#include <fmt/format.h>

#include <algorithm>

namespace atirma::console {
namespace {

std::string escaped(const std::string& text) {
    std::string made;
    for (char c : text) {
        switch (c) {
            case '&': made += "&amp;"; break;
            case '<': made += "&lt;"; break;
            case '>': made += "&gt;"; break;
            default: made += c;
        }
    }
    return made;
}

} // namespace

void track_store::add(track_point point) {
    auto place = std::lower_bound(points_.begin(), points_.end(), point.at,
                                  [](const track_point& p, utc_time at) { return p.at < at; });
    if (place != points_.end() && place->at == point.at) return;
    points_.insert(place, point);
    if (points_.size() > most_) thin();
    shared_.reset();
}

void track_store::clear() {
    points_.clear();
    shared_.reset();
}

std::shared_ptr<const std::vector<track_point>> track_store::points() {
    if (!shared_) shared_ = std::make_shared<const std::vector<track_point>>(points_);
    return shared_;
}

std::size_t track_store::bytes() const noexcept {
    return (points_.capacity() + (shared_ ? shared_->capacity() : 0)) * sizeof(track_point);
}

void track_store::thin() {
    auto half = points_.size() / 2;
    std::vector<track_point> kept;
    kept.reserve(points_.size());
    for (std::size_t i = 0; i < points_.size(); ++i)
        if (i >= half || i % 2 == 0) kept.push_back(points_[i]);
    points_ = std::move(kept);
}

std::string track_to_csv(const std::vector<track_point>& track) {
    std::string text = "time,latitude_deg,longitude_deg,speed_mps,link,history,boot\n";
    for (const auto& p : track)
        text += fmt::format("{},{:.7f},{:.7f},{:.2f},{},{},{}\n", ise::iso_8601(p.at, 3), p.latitude_deg,
                            p.longitude_deg, p.speed_mps, name_of(p.link), p.history ? 1 : 0, p.boot);
    return text;
}

bool is_outage(const track_point& before, const track_point& point, const report_rhythm& rhythm) noexcept {
    return age_s(point.at, before.at) >= rhythm.outage_s(before.link, point.link);
}

std::string track_to_gpx(const std::string& boat, const std::vector<track_point>& track,
                         const std::vector<waypoint>& list, const report_rhythm& rhythm) {
    std::string text = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
                       "<gpx version=\"1.1\" creator=\"atirma_console\" xmlns=\"http://www.topografix.com/GPX/1/1\">\n";
    if (!list.empty()) {
        text += fmt::format("<rte><name>{} waypoints</name>\n", escaped(boat));
        for (std::size_t i = 0; i < list.size(); ++i)
            text += fmt::format("<rtept lat=\"{:.7f}\" lon=\"{:.7f}\"><name>{}</name></rtept>\n", list[i].latitude_deg,
                                list[i].longitude_deg, i + 1);
        text += "</rte>\n";
    }
    text += fmt::format("<trk><name>{}</name>\n", escaped(boat));
    for (std::size_t i = 0; i < track.size(); ++i) {
        bool begins = i == 0 || is_outage(track[i - 1], track[i], rhythm);
        if (begins) text += i == 0 ? "<trkseg>\n" : "</trkseg>\n<trkseg>\n";
        text += fmt::format("<trkpt lat=\"{:.7f}\" lon=\"{:.7f}\"><time>{}</time></trkpt>\n", track[i].latitude_deg,
                            track[i].longitude_deg, ise::iso_8601(track[i].at, 3));
    }
    if (!track.empty()) text += "</trkseg>\n";
    return text + "</trk>\n</gpx>\n";
}

} // namespace atirma::console
