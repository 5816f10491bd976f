// The part of a mission on the real clock that is no process of the deployment; apps/demo --mission stress starts it.
#include "mission.hpp"

#include <apps/command_line.hpp>
#include <apps/stress/report.hpp>

#include <ise/core/complain.hpp>
#include <ise/core/real/environment.hpp>
#include <ise/naming/services.hpp>

#include <fmt/format.h>

#include <csignal>
#include <cstdio>
#include <filesystem>
#include <string_view>

namespace {

namespace stress = atirma::stress;

void complain(std::string_view what) { ise::complain("atirma_mission", what); }

/// "boat=LINK=DEVICE".
stress::mission_options::line line_of(const std::string& text) {
    auto first = text.find('='), second = text.find('=', first + 1);
    stress::mission_options::line made;
    if (first == std::string::npos || second == std::string::npos)
        throw command_line::parse_error("--line", "expected WHICH=LINK=DEVICE, not " + text);
    made.which = text.substr(0, first);
    made.link = text.substr(first + 1, second - first - 1);
    made.device = text.substr(second + 1);
    if (made.which != "boat" && made.which != "shore" && made.which != "iridium")
        throw command_line::parse_error("--line", "expected boat, shore or iridium, not " + made.which);
    return made;
}

/// "NAME=FILE".
stress::mission_options::window window_of(const std::string& text) {
    auto split = text.find('=');
    if (split == std::string::npos) throw command_line::parse_error("--window", "expected NAME=FILE, not " + text);
    return {text.substr(0, split), text.substr(split + 1)};
}

} // namespace

int main(int argc, char** argv) {
    command_line::app app(
        "Runs the script and the operators of a mission on the real clock and writes its report. The caller, "
        "which starts the processes of the deployment, kills and starts them by the lines on standard output.",
        "atirma_mission");
    stress::mission_options options;
    double length_s = 600;
    std::string out, names;
    std::vector<std::string> lines, windows;
    app.add_option("--seed", options.seed, "random seed of the plan")->capture_default_str();
    app.add_option("--for", length_s, "length in seconds, once the deployment is up")
        ->check(command_line::range(60.0, 86400.0))
        ->capture_default_str();
    app.add_option("--out", out, "folder for report.md, track.svg and track.gpx")->required();
    app.add_option("--name-server", names, "its endpoint (default: ISE_NAME_SERVER)")->envname("ISE_NAME_SERVER");
    app.add_option("--line", lines, "WHICH=LINK=DEVICE: a serial line that is recorded (boat, shore, iridium)");
    app.add_option("--carrier-tcp", options.carrier_tcp, "where the boat's connections are relayed");
    app.add_option("--carrier-udp", options.carrier_udp, "where the boat's datagrams are relayed");
    app.add_option("--store", options.stores,
                   "files of the communication nodes, the primary's first, or the URL of their database")
        ->expected(1, 2)
        ->required();
    app.add_option("--boat-memory", options.boat_memory, "file of the boat's computer")->required();
    app.add_option("--window", windows,
                   "NAME=FILE: an operator at a window, and what the window showed when it is left");
    app.add_option("--page", options.page, "host:port of the page");
    app.add_option("--wind", options.wind, "description of the wind, for the report");
    try {
        app.parse(argc, argv);
    } catch (const command_line::parse_error& why) {
        return app.exit(why);
    }
    try {
        for (const auto& text : lines) options.lines.push_back(line_of(text));
        for (const auto& text : windows) options.windows.push_back(window_of(text));
        options.names = names.empty() ? ise::default_name_server() : ise::endpoint::parse(names).value();
        options.length = std::chrono::duration_cast<ise::duration>(std::chrono::duration<double>(length_s));
        options.say = [](const std::string& line) {
            std::fputs((line + "\n").c_str(), stdout);
            std::fflush(stdout);
        };
        const std::filesystem::path folder(out);
        std::filesystem::create_directories(folder);
        std::signal(SIGPIPE, SIG_IGN);

        ise::real_environment world;
        ise::node_options terms;
        terms.name = "mission";
        terms.name_servers = {options.names};
        terms.log = ise::log_to_stderr(ise::log_level::error);
        stress::mission sea(world, std::move(terms), std::move(options));
        bool whole = sea.sail();
        if (!whole) {
            complain(sea.why());
            return 1;
        }
        const auto& proof = sea.proof();
        const auto result = sea.story();
        const stress::findings found(result);
        stress::write_file(folder / "report.md", stress::make_report(result, found, proof));
        stress::write_file(folder / "track.svg", stress::make_picture(result, found));
        stress::write_file(folder / "track.gpx", stress::make_gpx(found));
        bool good = stress::holds(result, proof);
        fmt::print("over {} on the real clock: {}; {}\n", stress::length_text(result.plan.length),
                   good ? "the proof holds" : "THE PROOF DOES NOT HOLD", (folder / "report.md").string());
        return good ? 0 : 1;
    } catch (const command_line::parse_error& why) {
        complain(why.what());
        return 2;
    } catch (const std::exception& why) {
        complain(why.what());
        return 1;
    }
}
