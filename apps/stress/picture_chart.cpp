// The upper part of track.svg: the bay with the track.
#include "picture_parts.hpp"

#include <components/boat_simulator/course.hpp>
#include <components/coast/coast.hpp>

#include <optional>
#include <utility>

namespace atirma::stress::svg {

using namespace std::chrono_literals;

projection fit(const findings& found) {
    const auto beach = short_range_node();
    double south = beach.latitude_deg, north = south, west = beach.longitude_deg, east = west;
    auto take = [&](double latitude, double longitude) {
        south = std::min(south, latitude);
        north = std::max(north, latitude);
        west = std::min(west, longitude);
        east = std::max(east, longitude);
    };
    for (const auto& one : found.track) take(one.latitude_deg, one.longitude_deg);
    for (const auto* name : {"T1", "T2"}) {
        const auto course = simulator::find_course(name);
        for (const auto& mark : course->marks) take(mark.latitude_deg, mark.longitude_deg);
    }
    take(28.1480, -15.4335); // some of La Isleta, which shelters the bay
    double high = (north - south) * 0.09, wide = (east - west) * 0.09;
    return projection(south - high, north + high, west - wide, east + wide);
}

namespace {

/// By which link the shore knew at that time where the boat was: the cheapest one that told it without delay.
std::vector<shade> shades_of(const std::vector<findings::fix>& track) {
    std::vector<shade> made(track.size(), afterwards);
    constexpr std::array<std::pair<link_id, std::chrono::seconds>, 2> order{
        {{link_id::xbee, 8s}, {link_id::gprs, 20s}}};
    std::array<std::optional<utc_time>, link_count> last;
    for (int direction = 0; direction < 2; ++direction) {
        last = {};
        for (std::size_t step = 0; step < track.size(); ++step) {
            auto i = direction == 0 ? step : track.size() - 1 - step;
            const auto& one = track[i];
            if (!one.history) last[static_cast<std::size_t>(one.link)] = one.at;
            for (const auto& [link, within] : order) {
                const auto& result = last[static_cast<std::size_t>(link)];
                if (!result || std::chrono::abs(one.at - *result) > within) continue;
                made[i] = std::min(made[i], static_cast<shade>(link));
                break;
            }
        }
    }
    return made;
}

constexpr double grid_deg = 0.005;
int first_line(double from_deg) { return static_cast<int>(std::ceil(from_deg / grid_deg)); }

void draw_degrees(drawing& to, const projection& by) {
    for (auto n = first_line(by.longitude(chart.left)); n * grid_deg < by.longitude(chart.right()); ++n)
        to.put("<text x=\"{:.1f}\" y=\"{}\" class=\"degree\" text-anchor=\"middle\">{:.3f}° W</text>",
               by.x(n * grid_deg), chart.bottom() + 16, std::abs(n * grid_deg));
    for (auto n = first_line(by.latitude(chart.bottom())); n * grid_deg < by.latitude(chart.top); ++n)
        to.put("<text transform=\"translate({} {:.1f}) rotate(-90)\" class=\"degree\" text-anchor=\"middle\">{:.3f}° "
               "N</text>",
               chart.left - 8, by.y(n * grid_deg), n * grid_deg);
}

void draw_sea_and_coast(drawing& to, const projection& by) {
    to.put("<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" fill=\"#dcebf3\"/>", chart.left, chart.top, chart.width,
           chart.height);
    for (auto n = first_line(by.longitude(chart.left)); n * grid_deg < by.longitude(chart.right()); ++n)
        to.put("<path d=\"M{:.1f} {}V{}\" class=\"grid\"/>", by.x(n * grid_deg), chart.top, chart.bottom());
    for (auto n = first_line(by.latitude(chart.bottom())); n * grid_deg < by.latitude(chart.top); ++n)
        to.put("<path d=\"M{} {:.1f}H{}\" class=\"grid\"/>", chart.left, by.y(n * grid_deg), chart.right());
    for (const auto& ring : coast_rings()) {
        std::string path;
        bool seen = false;
        for (const auto& point : ring.points) {
            double x = by.x(point.longitude_deg), y = by.y(point.latitude_deg);
            seen = seen ||
                   (x > chart.left - 200 && x < chart.right() + 200 && y > chart.top - 200 && y < chart.bottom() + 200);
            fmt::format_to(std::back_inserter(path), "{}{:.1f} {:.1f}", path.empty() ? "M" : "L", x, y);
        }
        if (seen)
            to.put(
                "<path d=\"{}Z\" fill=\"#efe8d8\" stroke=\"#9c9178\" stroke-width=\"1.4\" stroke-linejoin=\"round\"/>",
                path);
    }
    for (const auto& place : coast_places()) {
        double x = by.x(place.at.longitude_deg), y = by.y(place.at.latitude_deg);
        if (x < chart.left + 60 || x > chart.right() - 60 || y < chart.top + 20 || y > chart.bottom() - 20) continue;
        to.put("<text x=\"{:.1f}\" y=\"{:.1f}\" class=\"{}\" text-anchor=\"middle\">{}</text>", x, y,
               place.sea ? "sea" : "land", xml(place.name));
    }
}

void draw_track(drawing& to, const projection& by, const findings& found) {
    const auto shade_of = shades_of(found.track);
    // What was known late lies below, Iridium's few fixes above.
    for (auto wanted : {afterwards, over_gprs, over_xbee}) {
        std::string path;
        double drawn_x = 0, drawn_y = 0;
        bool open = false;
        for (std::size_t i = 1; i < found.track.size(); ++i) {
            if (shade_of[i] != wanted || found.track[i].at - found.track[i - 1].at > 5min) {
                open = false;
                continue;
            }
            auto point = [&](const findings::fix& at, bool last) {
                double x = by.x(at.longitude_deg), y = by.y(at.latitude_deg);
                if (open && !last && std::hypot(x - drawn_x, y - drawn_y) < 2) return;
                fmt::format_to(std::back_inserter(path), "{}{:.1f} {:.1f}", open ? "L" : "M", x, y);
                drawn_x = x;
                drawn_y = y;
                open = true;
            };
            if (!open) point(found.track[i - 1], false);
            bool ends = i + 1 == found.track.size() || shade_of[i + 1] != wanted;
            point(found.track[i], ends);
        }
        if (!path.empty())
            to.put("<path d=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"{}\" stroke-linejoin=\"round\" "
                   "stroke-linecap=\"round\" opacity=\"0.85\"/>",
                   path, styles[wanted].colour, wanted == afterwards ? "2.6" : "1.7");
    }
    for (const auto& one : found.track)
        if (one.link == link_id::iridium)
            to.put("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"4\" fill=\"{}\" stroke=\"#fff\" stroke-width=\"1.2\"/>",
                   by.x(one.longitude_deg), by.y(one.latitude_deg), styles[over_iridium].colour);
}

void draw_marks(drawing& to, const projection& by, const account& of) {
    for (const auto* name : {"T1", "T2"}) {
        const auto course = simulator::find_course(name);
        std::string outline;
        for (const auto& mark : course->marks)
            fmt::format_to(std::back_inserter(outline), "{:.1f},{:.1f} ", by.x(mark.longitude_deg),
                           by.y(mark.latitude_deg));
        to.put("<polygon points=\"{}\" fill=\"none\" stroke=\"#39424c\" stroke-width=\"1\" stroke-dasharray=\"2 5\"/>",
               outline);
        int number = 0;
        for (const auto& mark : course->marks) {
            double x = by.x(mark.longitude_deg), y = by.y(mark.latitude_deg);
            to.put("<path d=\"M{0:.1f} {1:.1f}l7 7l-7 7l-7 -7Z\" fill=\"#f3a712\" stroke=\"#39424c\" "
                   "stroke-width=\"1.2\"/>",
                   x, y - 7);
            to.put("<text x=\"{:.1f}\" y=\"{:.1f}\" class=\"mark\">{}·{}</text>", x + 11, y - 8, name, ++number);
        }
    }
    const auto beach = short_range_node();
    double x = by.x(beach.longitude_deg), y = by.y(beach.latitude_deg);
    if (of.xbee_range_m > 0)
        to.put("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"{:.1f}\" fill=\"none\" stroke=\"{}\" stroke-width=\"1.2\" "
               "stroke-dasharray=\"7 6\" opacity=\"0.7\"/>",
               x, y, by.pixels(of.xbee_range_m), styles[over_xbee].colour);
    to.put("<path d=\"M{0:.1f} {1:.1f}l7 12h-14Z\" fill=\"{2}\" stroke=\"#fff\" stroke-width=\"1.2\"/>", x, y - 8,
           styles[over_xbee].colour);
    to.put("<text x=\"{:.1f}\" y=\"{:.1f}\" class=\"mark\" text-anchor=\"middle\">short-range node</text>", x, y + 20);
}

void draw_furniture(drawing& to, const projection& by) {
    double left = chart.left + 26, y = chart.bottom() - 28, half = by.pixels(250);
    to.put("<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"46\" rx=\"5\" fill=\"#fff\" opacity=\"0.85\"/>",
           left - 14, y - 26, 2 * half + 44);
    to.put("<rect x=\"{0:.1f}\" y=\"{1:.1f}\" width=\"{2:.1f}\" height=\"6\" fill=\"#39424c\"/><rect x=\"{3:.1f}\" "
           "y=\"{1:.1f}\" width=\"{2:.1f}\" height=\"6\" fill=\"#fff\" stroke=\"#39424c\"/>",
           left, y, half, left + half);
    int n = 0;
    for (const auto* text : {"0", "250", "500 m"})
        to.put("<text x=\"{:.1f}\" y=\"{:.1f}\" class=\"degree\" text-anchor=\"middle\">{}</text>", left + half * n++,
               y - 8, text);
    double x = chart.right() - 42, top = chart.top + 30;
    to.put("<path d=\"M{0:.1f} {1:.1f}l9 34l-9 -8l-9 8Z\" fill=\"#39424c\"/><text x=\"{0:.1f}\" y=\"{2:.1f}\" "
           "class=\"mark\" text-anchor=\"middle\">N</text>",
           x, top, top + 52);
    to.put("<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" fill=\"none\" stroke=\"#39424c\" stroke-width=\"1.2\"/>",
           chart.left, chart.top, chart.width, chart.height);
}

} // namespace

void draw_chart(drawing& to, const projection& by, const account& of, const findings& found) {
    to.put("<g clip-path=\"url(#chart)\">");
    draw_sea_and_coast(to, by);
    draw_track(to, by, found);
    draw_marks(to, by, of);
    to.put("</g>");
    draw_degrees(to, by);
    draw_furniture(to, by);
}

} // namespace atirma::stress::svg
