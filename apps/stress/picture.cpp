// The track as a chart: SVG without scripts, fonts or pictures of others.
#include "report.hpp"

#include <components/boat_simulator/course.hpp>
#include <components/coast/coast.hpp>
#include <components/web_server/track_export.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>

namespace atirma::stress {
namespace {

using namespace std::chrono_literals;

constexpr double radians = 3.14159265358979323846 / 180, metres_a_degree = 111'195;
constexpr waypoint beach{28.1580, -15.4408};

struct box {
    double left, top, width, height;
    double right() const { return left + width; }
    double bottom() const { return top + height; }
};
constexpr box chart{40, 96, 1040, 820};
constexpr box panel{1104, 96, 256, 820};
constexpr box times{150, 968, 1210, 168};

enum shade : std::size_t { over_xbee, over_gprs, over_iridium, afterwards, shades };
struct style {
    const char* colour;
    const char* name;
};
constexpr std::array<style, shades> styles{
    {{"#0f8a4b", "XBee"}, {"#1f62c4", "GPRS"}, {"#c9342d", "Iridium"}, {"#8fb2e8", "GPRS, told afterwards"}}};

std::string xml(std::string_view text) {
    std::string safe;
    for (char c : text) {
        if (c == '&') safe += "&amp;";
        else if (c == '<') safe += "&lt;";
        else safe += c;
    }
    return safe;
}

class drawing {
public:
    template <class... A>
    void put(fmt::format_string<A...> how, A&&... what) {
        fmt::format_to(std::back_inserter(all), how, std::forward<A>(what)...);
        all += '\n';
    }
    std::string all;
};

/// Places to points of the picture: a plane is good enough for a bay.
class projection {
public:
    projection(double south, double north, double west, double east) {
        middle_latitude_ = (south + north) / 2;
        middle_longitude_ = (west + east) / 2;
        double wide = (east - west) * std::cos(middle_latitude_ * radians) * metres_a_degree,
               high = (north - south) * metres_a_degree;
        scale_ = std::min(chart.width / wide, chart.height / high);
    }
    double x(double longitude) const {
        return chart.left + chart.width / 2 +
               (longitude - middle_longitude_) * std::cos(middle_latitude_ * radians) * metres_a_degree * scale_;
    }
    double y(double latitude) const {
        return chart.top + chart.height / 2 - (latitude - middle_latitude_) * metres_a_degree * scale_;
    }
    double latitude(double y) const {
        return middle_latitude_ - (y - chart.top - chart.height / 2) / scale_ / metres_a_degree;
    }
    double longitude(double x) const {
        return middle_longitude_ +
               (x - chart.left - chart.width / 2) / scale_ / metres_a_degree / std::cos(middle_latitude_ * radians);
    }
    double pixels(double metres) const { return metres * scale_; }

private:
    double middle_latitude_, middle_longitude_, scale_;
};

projection fit(const findings& found) {
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
                const auto& told = last[static_cast<std::size_t>(link)];
                if (!told || std::chrono::abs(one.at - *told) > within) continue;
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

void draw_marks(drawing& to, const projection& by, const voyage& of) {
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
    double x = by.x(beach.longitude_deg), y = by.y(beach.latitude_deg);
    to.put("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"{:.1f}\" fill=\"none\" stroke=\"{}\" stroke-width=\"1.2\" "
           "stroke-dasharray=\"7 6\" opacity=\"0.7\"/>",
           x, y, by.pixels(of.options().xbee_range_m), styles[over_xbee].colour);
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

void draw_panel(drawing& to, const voyage& of, const findings& found) {
    double x = panel.left, y = panel.top + 18;
    auto heading = [&](std::string_view text) {
        to.put("<text x=\"{:.0f}\" y=\"{:.0f}\" class=\"heading\">{}</text>", x, y, text);
        y += 24;
    };
    auto line = [&](const std::string& text, double indent = 0) {
        to.put("<text x=\"{:.0f}\" y=\"{:.0f}\" class=\"text\">{}</text>", x + indent, y, text);
        y += 20;
    };
    heading("The track, by the link");
    for (std::size_t i = 0; i < shades; ++i) {
        if (i == over_iridium)
            to.put("<circle cx=\"{:.0f}\" cy=\"{:.0f}\" r=\"5\" fill=\"{}\"/>", x + 14, y - 5, styles[i].colour);
        else
            to.put("<path d=\"M{:.0f} {:.0f}h28\" stroke=\"{}\" stroke-width=\"4\" stroke-linecap=\"round\"/>", x,
                   y - 5, styles[i].colour);
        line(styles[i].name, 40);
    }
    y += 16;
    heading("On the disks of both nodes");
    for (std::size_t i = 0; i < link_count; ++i) {
        std::uint64_t all = 0;
        for (const auto& [type, count] : found.by_type[i]) all += count;
        line(fmt::format("{}: {} packets", styles[i].name, all));
    }
    y += 16;
    heading("The voyage");
    line(fmt::format("{:.1f} km in {}", found.sailed_m / 1000, length_text(of.script().length)));
    if (of.options().wind_csv.empty())
        line(fmt::format("wind {:.1f} m/s from {:.0f}°, gusts", of.script().wind_speed_mps, of.script().wind_from_deg));
    else line("recorded wind");
    std::size_t given = 0, done = 0;
    for (const auto& who : of.operator_records()) {
        given += who.commands.size();
        done += static_cast<std::size_t>(
            std::ranges::count_if(who.commands, [](const auto& one) { return one.result == ack_code::done; }));
    }
    line(fmt::format("{} telecommands, {} done", given, done));
    line(fmt::format("{} troubles by the script", of.script().faults.size()));
    to.put("<text x=\"{:.0f}\" y=\"{:.0f}\" class=\"small\" text-anchor=\"end\">{}</text>", chart.right() - 8,
           chart.bottom() - 8, xml(coast_attribution()));
}

void draw_times(drawing& to, const voyage& of, const findings& found) {
    const auto length = of.script().length;
    auto x = [&](ise::duration at) {
        return times.left +
               times.width *
                   std::clamp(static_cast<double>(at.count()) / static_cast<double>(length.count()), 0.0, 1.0);
    };
    struct row {
        const char* name;
        const char* colour;
        std::vector<findings::span> there;
    };
    auto without = [&](trouble what) {
        std::vector<findings::span> made;
        ise::duration since{};
        for (const auto& one : of.episodes()) {
            if (one.what != describe(what)) continue;
            made.push_back({since, one.from});
            since = one.until < one.from ? length : one.until;
        }
        made.push_back({since, length});
        return made;
    };
    const std::array<row, 7> rows{{{"XBee", styles[over_xbee].colour, found.heard[0]},
                                   {"GPRS", styles[over_gprs].colour, found.heard[1]},
                                   {"Iridium", styles[over_iridium].colour, found.heard[2]},
                                   {"node 1", "#6b7683", without(trouble::primary_killed)},
                                   {"node 2", "#6b7683", without(trouble::secondary_killed)},
                                   {"name server", "#6b7683", without(trouble::names_restarted)},
                                   {"operator ana", "#6b7683", without(trouble::operator_away)}}};
    const double pitch = times.height / static_cast<double>(rows.size());
    auto minutes = std::chrono::duration_cast<std::chrono::minutes>(length).count();
    auto step = minutes > 180  ? std::chrono::minutes(60)
                : minutes > 40 ? std::chrono::minutes(10)
                               : std::chrono::minutes(2);
    for (ise::duration at{}; at <= length; at += step) {
        auto passed = std::chrono::duration_cast<std::chrono::minutes>(at).count();
        to.put("<path d=\"M{0:.1f} {1}V{2}\" stroke=\"#c6ced6\"/><text x=\"{0:.1f}\" y=\"{3}\" class=\"degree\" "
               "text-anchor=\"middle\">{4}:{5:02}</text>",
               x(at), times.top - 4, times.bottom(), times.bottom() + 16, passed / 60, passed % 60);
    }
    for (std::size_t i = 0; i < rows.size(); ++i) {
        double y = times.top + pitch * static_cast<double>(i);
        to.put("<text x=\"{:.0f}\" y=\"{:.1f}\" class=\"text\" text-anchor=\"end\">{}</text>", times.left - 12,
               y + pitch * 0.68, rows[i].name);
        to.put("<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" fill=\"#eef1f4\"/>", times.left,
               y + 4, times.width, pitch - 8);
        for (const auto& one : rows[i].there)
            if (one.until > one.from)
                to.put("<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" fill=\"{}\"/>", x(one.from),
                       y + 4, std::max(0.6, x(one.until) - x(one.from)), pitch - 8, rows[i].colour);
    }
}

} // namespace

std::string make_picture(voyage& of, const findings& found) {
    drawing to;
    to.put("<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 1400 1176\" width=\"1400\" height=\"1176\" "
           "font-family=\"Helvetica, Arial, sans-serif\">");
    to.put("<style>.grid{{stroke:#b9d0dc;stroke-width:.8}}.degree{{font-size:12px;fill:#5d6873}}.text{{font-size:14."
           "5px;fill:#2a323a}}.small{{font-size:10.5px;fill:#7a848e}}"
           ".heading{{font-size:15.5px;font-weight:bold;fill:#2a323a}}.mark{{font-size:13.5px;font-weight:bold;fill:#"
           "2a323a;paint-order:stroke;stroke:#fff;stroke-width:3px;"
           "stroke-opacity:.8}}.sea{{font-size:17px;font-style:italic;fill:#5f8ba3;letter-spacing:1px}}.land{{font-"
           "size:16px;fill:#85795f;letter-spacing:1px}}</style>");
    to.put("<rect width=\"1400\" height=\"1176\" fill=\"#fff\"/>");
    to.put("<text x=\"40\" y=\"48\" font-size=\"28\" font-weight=\"bold\" fill=\"#2a323a\">A-Tirma: {} in the bay of "
           "El Confital</text>",
           of.script().length % 1h == 0s ? fmt::format("{} hours", of.script().length / 1h)
                                         : length_text(of.script().length));
    to.put("<text x=\"40\" y=\"76\" class=\"text\">Virtual clock, seed {}. Course T1, from the middle on T2; every "
           "link with holes, every server killed in turn.</text>",
           of.options().seed);
    to.put("<clipPath id=\"chart\"><rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\"/></clipPath>", chart.left,
           chart.top, chart.width, chart.height);
    const auto by = fit(found);
    to.put("<g clip-path=\"url(#chart)\">");
    draw_sea_and_coast(to, by);
    draw_track(to, by, found);
    draw_marks(to, by, of);
    to.put("</g>");
    draw_degrees(to, by);
    draw_furniture(to, by);
    draw_panel(to, of, found);
    draw_times(to, of, found);
    to.put("</svg>");
    return std::move(to.all);
}

std::string make_gpx(const findings& found) {
    std::vector<track_point> track;
    for (const auto& one : found.track) {
        auto& point = track.emplace_back();
        point.at = one.at;
        point.latitude_deg = one.latitude_deg;
        point.longitude_deg = one.longitude_deg;
    }
    std::vector<track_waypoint> marks;
    for (const auto* name : {"T1", "T2"}) {
        const auto course = simulator::find_course(name);
        int number = 0;
        for (const auto& mark : course->marks)
            marks.push_back({mark.latitude_deg, mark.longitude_deg, fmt::format("{}.{}", name, ++number)});
    }
    return to_gpx("A-Tirma", track, marks);
}

} // namespace atirma::stress
