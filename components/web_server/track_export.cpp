#include <components/web_server/track_export.hpp>

#include <components/web_server/track_json.hpp>

#include <ise/core/time_text.hpp>

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <ctime>
#include <iterator>

namespace atirma {

namespace {
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

bool is_rough(const track_point& point) { return point.circular_error_m.value_or(0) > rough_fix_m; }

bool is_outage(const track_point& before, const track_point& point, const std::vector<std::string>& links,
               const report_rhythm& rhythm) {
    auto link_of = [&](const track_point& one) {
        return one.source < links.size() ? from_name<link_id>(links[one.source]).value_or(link_id::xbee)
                                         : link_id::xbee;
    };
    // Thinned points keep the longest silence before them, which is shorter than the time between them.
    auto silence = point.silence.count() > 0 ? point.silence : point.at - before.at;
    return std::chrono::duration<double>(silence).count() >= rhythm.outage_s(link_of(before), link_of(point));
}

std::string name_of(const track_waypoint& point, std::size_t index) {
    return point.name.empty() ? fmt::format("WP{}", index + 1) : xml(point.name);
}
} // namespace

std::string iso_8601(utc_ms at) {
    bool whole = std::chrono::floor<std::chrono::seconds>(at) == at;
    return ise::iso_8601(at, whole ? 0 : 3);
}

std::string to_gpx(std::string_view boat, const std::vector<track_point>& track,
                   const std::vector<track_waypoint>& waypoints, const std::vector<std::string>& links,
                   const report_rhythm& rhythm) {
    std::string out;
    out +=
        fmt::format("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
                    "<gpx version=\"1.1\" creator=\"ISE web server\" xmlns=\"http://www.topografix.com/GPX/1/1\">\n");
    if (!waypoints.empty()) {
        out += fmt::format("<rte><name>{} course</name>\n", xml(boat));
        for (std::size_t i = 0; i < waypoints.size(); ++i)
            out += fmt::format("<rtept lat=\"{:.7f}\" lon=\"{:.7f}\"><name>{}</name></rtept>\n",
                               waypoints[i].latitude_deg, waypoints[i].longitude_deg, name_of(waypoints[i], i));
        out += "</rte>\n";
    }
    if (!track.empty()) {
        out += fmt::format("<trk><name>{}</name>\n<trkseg>\n", xml(boat));
        const track_point* previous = nullptr;
        for (const auto& point : track) {
            if (is_rough(point)) continue;
            if (previous && is_outage(*previous, point, links, rhythm)) out += "</trkseg>\n<trkseg>\n";
            out += fmt::format("<trkpt lat=\"{:.7f}\" lon=\"{:.7f}\"><time>{}</time></trkpt>\n", point.latitude_deg,
                               point.longitude_deg, iso_8601(point.at));
            previous = &point;
        }
        out += "</trkseg>\n</trk>\n";
    }
    return out += "</gpx>\n";
}

std::string to_kml(std::string_view boat, const std::vector<track_point>& all,
                   const std::vector<track_waypoint>& waypoints) {
    std::vector<track_point> track;
    std::ranges::copy_if(all, std::back_inserter(track), [](const track_point& point) { return !is_rough(point); });
    std::string out;
    out += fmt::format("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
                       "<kml xmlns=\"http://www.opengis.net/kml/2.2\" xmlns:gx=\"http://www.google.com/kml/ext/2.2\">\n"
                       "<Document><name>{}</name>\n"
                       "<Style id=\"track\"><LineStyle><color>ff2a7fff</color><width>3</width></LineStyle></Style>\n",
                       xml(boat));
    for (std::size_t i = 0; i < waypoints.size(); ++i)
        out += fmt::format(
            "<Placemark><name>{}</name><Point><coordinates>{:.7f},{:.7f}</coordinates></Point></Placemark>\n",
            name_of(waypoints[i], i), waypoints[i].longitude_deg, waypoints[i].latitude_deg);
    if (!track.empty()) {
        out += fmt::format("<Placemark><name>{} track</name><styleUrl>#track</styleUrl><gx:Track>\n", xml(boat));
        for (const auto& point : track) out += fmt::format("<when>{}</when>\n", iso_8601(point.at));
        for (const auto& point : track)
            out += fmt::format("<gx:coord>{:.7f} {:.7f} 0</gx:coord>\n", point.longitude_deg, point.latitude_deg);
        const auto& last = track.back();
        out += fmt::format(
            "</gx:Track></Placemark>\n"
            "<Placemark><name>{}</name><description>Last position, {}</description>"
            "<TimeStamp><when>{}</when></TimeStamp><Point><coordinates>{:.7f},{:.7f}</coordinates></Point></"
            "Placemark>\n",
            xml(boat), iso_8601(last.at), iso_8601(last.at), last.longitude_deg, last.latitude_deg);
    }
    for (const auto& point : all)
        if (is_rough(point))
            out += fmt::format("<Placemark><name>Rough fix</name><description>Within about {:.0f} "
                               "m</description><TimeStamp><when>{}</when></TimeStamp>"
                               "<Point><coordinates>{:.7f},{:.7f}</coordinates></Point></Placemark>\n",
                               *point.circular_error_m, iso_8601(point.at), point.longitude_deg, point.latitude_deg);
    return out += "</Document></kml>\n";
}

std::string to_csv(const std::vector<track_point>& track, const std::vector<std::string>& links) {
    std::string out = "time_utc,latitude_deg,longitude_deg,speed_mps,course_deg,heading_deg,heel_deg,wind_speed_mps,"
                      "wind_direction_deg,"
                      "circular_error_m,link\r\n";
    for (const auto& point : track) {
        out += fmt::format("{},{:.7f},{:.7f}", iso_8601(point.at), point.latitude_deg, point.longitude_deg);
        for (const auto& value : {point.speed_mps, point.course_deg, point.heading_deg, point.heel_deg,
                                  point.wind_speed_mps, point.wind_direction_deg, point.circular_error_m}) {
            if (value) out += fmt::format(",{:.2f}", *value);
            else out += ',';
        }
        out += fmt::format(",{}\r\n", point.source < links.size() ? links[point.source] : std::string());
    }
    return out;
}

std::string to_geojson(std::string_view boat, const std::vector<track_point>& track,
                       const std::vector<track_waypoint>& waypoints, const std::vector<std::string>& links,
                       const report_rhythm& rhythm) {
    auto place = [](const auto& at) {
        return json::array({rounded(at.longitude_deg, 7), rounded(at.latitude_deg, 7)});
    };
    auto feature = [](json geometry, json properties) {
        return json{{"type", "Feature"}, {"geometry", std::move(geometry)}, {"properties", std::move(properties)}};
    };
    json lines = json::array(), times = json::array(), features = json::array();
    const track_point* previous = nullptr;
    for (const auto& point : track) {
        if (is_rough(point)) {
            features.push_back(feature({{"type", "Point"}, {"coordinates", place(point)}},
                                       {{"kind", "rough fix"},
                                        {"time", iso_8601(point.at)},
                                        {"circular_error_m", rounded(*point.circular_error_m, 0)},
                                        {"link", point.source < links.size() ? links[point.source] : std::string()}}));
            continue;
        }
        if (!previous || is_outage(*previous, point, links, rhythm)) {
            lines.push_back(json::array());
            times.push_back(json::array());
        }
        lines.back().push_back(place(point));
        times.back().push_back(iso_8601(point.at));
        previous = &point;
    }
    for (std::size_t i = 0; i < lines.size(); ++i) // a line has two places at least
        if (lines[i].size() == 1) lines[i].push_back(lines[i][0]), times[i].push_back(times[i][0]);
    for (std::size_t i = 0; i < waypoints.size(); ++i)
        features.push_back(
            feature({{"type", "Point"}, {"coordinates", place(waypoints[i])}},
                    {{"kind", "waypoint"},
                     {"name", waypoints[i].name.empty() ? fmt::format("WP{}", i + 1) : waypoints[i].name}}));
    features.insert(features.begin(),
                    feature({{"type", "MultiLineString"}, {"coordinates", std::move(lines)}},
                            {{"kind", "track"}, {"name", std::string(boat)}, {"coordTimes", std::move(times)}}));
    return to_text({{"type", "FeatureCollection"}, {"features", std::move(features)}}) + "\n";
}

} // namespace atirma
