// The track as a chart: SVG without scripts, fonts or pictures of others.
#include "picture_parts.hpp"
#include "report.hpp"

#include <components/boat/enums.hpp>
#include <components/boat_simulator/course.hpp>
#include <components/coast/coast.hpp>
#include <components/web_server/track_export.hpp>

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

namespace atirma::stress {
namespace {

using namespace svg;

void draw_panel(drawing& to, const account& of, const findings& found) {
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
    line(fmt::format("{:.1f} km in {}", of.sailed_m / 1000, voyage_text(of.plan.length)));
    line(of.wind);
    std::size_t given = 0, done = 0;
    for (const auto& who : of.people) {
        given += who.commands.size();
        done += static_cast<std::size_t>(
            std::ranges::count_if(who.commands, [](const auto& one) { return one.result == ack_code::done; }));
    }
    line(fmt::format("{} telecommands, {} done", given, done));
    line(fmt::format("{} faults by the script", of.plan.faults.size()));
    to.put("<text x=\"{:.0f}\" y=\"{:.0f}\" class=\"small\" text-anchor=\"end\">{}</text>", chart.right() - 8,
           chart.bottom() - 8, xml(coast_attribution()));
}

void draw_times(drawing& to, const account& of, const findings& found) {
    const auto length = of.plan.length;
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
    auto without = [&](trouble what, trouble or_this) {
        std::vector<findings::span> made;
        ise::duration since{};
        for (const auto& one : of.episodes) {
            if (one.what != describe(what) && one.what != describe(or_this)) continue;
            made.push_back({since, one.from});
            since = one.until < one.from ? length : one.until;
        }
        made.push_back({since, length});
        return made;
    };
    const std::array<row, 7> rows{
        {{"XBee", styles[over_xbee].colour, found.heard[0]},
         {"GPRS", styles[over_gprs].colour, found.heard[1]},
         {"Iridium", styles[over_iridium].colour, found.heard[2]},
         {"node 1", "#6b7683", without(trouble::primary_killed, trouble::primary_set_back)},
         {"node 2", "#6b7683", without(trouble::secondary_killed, trouble::secondary_set_back)},
         {"name server", "#6b7683", without(trouble::names_restarted, trouble::names_restarted)},
         {"operator ana", "#6b7683", without(trouble::operator_away, trouble::operator_away)}}};
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

std::string make_picture(const account& of, const findings& found) {
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
           voyage_text(of.plan.length));
    to.put("<text x=\"40\" y=\"76\" class=\"text\">{} clock, seed {}. Course T1, from the middle on T2; every "
           "link with holes, every server killed in turn.</text>",
           of.virtual_clock ? "Virtual" : "Real", of.seed);
    to.put("<clipPath id=\"chart\"><rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\"/></clipPath>", chart.left,
           chart.top, chart.width, chart.height);
    const auto by = fit(found);
    draw_chart(to, by, of, found);
    draw_panel(to, of, found);
    draw_times(to, of, found);
    to.put("</svg>");
    return std::move(to.all);
}

std::string make_gpx(const findings& found) {
    std::vector<track_point> track;
    std::vector<std::string> links;
    for (const auto& [name, value] : names_of<link_id>()) links.emplace_back(name);
    report_rhythm rhythm;
    for (const auto& one : found.track) {
        if (!one.history) rhythm.on_report(one.link, one.at);
        if (!track.empty() && track.back().at == one.at) continue; // told over another link as well
        auto& point = track.emplace_back();
        point.at = one.at;
        point.latitude_deg = one.latitude_deg;
        point.longitude_deg = one.longitude_deg;
        auto known = std::ranges::find(links, name_of(one.link));
        point.source = static_cast<std::uint32_t>(known - links.begin());
    }
    std::vector<track_waypoint> marks;
    for (const auto* name : {"T1", "T2"}) {
        const auto course = simulator::find_course(name);
        int number = 0;
        for (const auto& mark : course->marks)
            marks.push_back({mark.latitude_deg, mark.longitude_deg, fmt::format("{}.{}", name, ++number)});
    }
    return to_gpx("A-Tirma", track, marks, links, rhythm);
}

} // namespace atirma::stress
