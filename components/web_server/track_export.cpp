#include <components/web_server/track_export.hpp>

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <ctime>
#include <iterator>

namespace atirma {

namespace {
constexpr std::chrono::minutes gap_between_segments{10};

/// Text of strangers inside XML: escaped, without the control characters that XML forbids.
std::string xml(std::string_view text) {
    std::string safe;
    for (char c : text) {
        switch (c) {
            case '&': safe += "&amp;"; break;
            case '<': safe += "&lt;"; break;
            case '>': safe += "&gt;"; break;
            case '"': safe += "&quot;"; break;
            default:
                if (static_cast<unsigned char>(c) >= 0x20) safe += c;
        }
    }
    return safe;
}

std::string iso(utc_ms at) {
    auto seconds = std::chrono::floor<std::chrono::seconds>(at);
    auto rest_ms = (at - seconds).count();
    auto text = fmt::format("{:%Y-%m-%dT%H:%M:%S}", fmt::gmtime(static_cast<std::time_t>(seconds.time_since_epoch().count())));
    return rest_ms == 0 ? text + "Z" : fmt::format("{}.{:03}Z", text, rest_ms);
}

std::string name_of(const track_waypoint& point, std::size_t index) {
    return point.name.empty() ? fmt::format("WP{}", index + 1) : xml(point.name);
}
} // namespace

std::string to_gpx(std::string_view boat, const std::vector<track_point>& track, const std::vector<track_waypoint>& waypoints) {
    std::string out;
    auto to = std::back_inserter(out);
    fmt::format_to(to,
                   "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
                   "<gpx version=\"1.1\" creator=\"ISE web server\" xmlns=\"http://www.topografix.com/GPX/1/1\">\n");
    if (!waypoints.empty()) {
        fmt::format_to(to, "<rte><name>{} course</name>\n", xml(boat));
        for (std::size_t i = 0; i < waypoints.size(); ++i)
            fmt::format_to(to, "<rtept lat=\"{:.7f}\" lon=\"{:.7f}\"><name>{}</name></rtept>\n", waypoints[i].latitude_deg,
                           waypoints[i].longitude_deg, name_of(waypoints[i], i));
        out += "</rte>\n";
    }
    if (!track.empty()) {
        fmt::format_to(to, "<trk><name>{}</name>\n<trkseg>\n", xml(boat));
        const track_point* previous = nullptr;
        for (const auto& point : track) {
            if (previous && point.at - previous->at > gap_between_segments) out += "</trkseg>\n<trkseg>\n";
            fmt::format_to(to, "<trkpt lat=\"{:.7f}\" lon=\"{:.7f}\"><time>{}</time></trkpt>\n", point.latitude_deg,
                           point.longitude_deg, iso(point.at));
            previous = &point;
        }
        out += "</trkseg>\n</trk>\n";
    }
    return out += "</gpx>\n";
}

std::string to_kml(std::string_view boat, const std::vector<track_point>& track, const std::vector<track_waypoint>& waypoints) {
    std::string out;
    auto to = std::back_inserter(out);
    fmt::format_to(to,
                   "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
                   "<kml xmlns=\"http://www.opengis.net/kml/2.2\" xmlns:gx=\"http://www.google.com/kml/ext/2.2\">\n"
                   "<Document><name>{}</name>\n"
                   "<Style id=\"track\"><LineStyle><color>ff2a7fff</color><width>3</width></LineStyle></Style>\n",
                   xml(boat));
    for (std::size_t i = 0; i < waypoints.size(); ++i)
        fmt::format_to(to, "<Placemark><name>{}</name><Point><coordinates>{:.7f},{:.7f}</coordinates></Point></Placemark>\n",
                       name_of(waypoints[i], i), waypoints[i].longitude_deg, waypoints[i].latitude_deg);
    if (!track.empty()) {
        fmt::format_to(to, "<Placemark><name>{} track</name><styleUrl>#track</styleUrl><gx:Track>\n", xml(boat));
        for (const auto& point : track) fmt::format_to(to, "<when>{}</when>\n", iso(point.at));
        for (const auto& point : track) fmt::format_to(to, "<gx:coord>{:.7f} {:.7f} 0</gx:coord>\n", point.longitude_deg, point.latitude_deg);
        const auto& last = track.back();
        fmt::format_to(to,
                       "</gx:Track></Placemark>\n"
                       "<Placemark><name>{}</name><description>Last position, {}</description>"
                       "<TimeStamp><when>{}</when></TimeStamp><Point><coordinates>{:.7f},{:.7f}</coordinates></Point></Placemark>\n",
                       xml(boat), iso(last.at), iso(last.at), last.longitude_deg, last.latitude_deg);
    }
    return out += "</Document></kml>\n";
}

} // namespace atirma
