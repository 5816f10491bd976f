// ise ps: what instantiation servers have started.
#include "hosts.hpp"
#include "json.hpp"
#include "options.hpp"
#include "table.hpp"
#include "text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <memory>

namespace ise::cli {
namespace {

struct ps_options {
    std::string prefix, host;
    bool names = false;
};

// "4711", where others run in it too "4711 (main)", and with its own user and identity "4711 as pi with xbee".
std::string process_of(const instantiation::instance_info& what) {
    auto text = what.process_id == 0 ? std::string("-") : std::to_string(what.process_id);
    if (!what.process.empty()) return fmt::format("{} ({})", text, what.process);
    if (!what.user.empty()) text += fmt::format(" as {}", what.user);
    if (!what.identity.empty()) text += fmt::format(" with {}", what.identity);
    return text;
}

// Its last state change, and its present problems.
std::string remarks(const instantiation::instance_info& what) {
    std::string text = what.rebuilt ? "program was rebuilt" : "";
    auto add = [&](const std::string& more) { text += (text.empty() ? "" : "; ") + more; };
    if (!what.reason.empty()) add(what.reason);
    if (!what.probe_trouble.empty() && what.probe_trouble != what.reason) add(what.probe_trouble);
    if (what.output_dropped > 0)
        add(fmt::format("{} of its output were dropped{}{}", show_bytes(what.output_dropped),
                        what.output_trouble.empty() ? "" : ": ", what.output_trouble));
    return text;
}

task<> ps(context& in, ps_options options) {
    auto all = co_await instances_there(in, options.host, options.prefix);
    std::string text;
    if (options.names) {
        for (const auto& one : all) text += printable(one.instance.path) + "\n";
    } else if (in.set.json) {
        std::vector<instance_line> lines;
        for (const auto& one : all) lines.push_back(line_of(one.host.name, one.instance));
        text = json_line(lines);
    } else {
        table rows({"PATH", "STATE", "HOST", "PROCESS", "FOR", "RESTARTS", "DEPLOYMENT", "TYPE", "WHY"});
        for (const auto& one : all) {
            const auto& what = one.instance;
            auto length = std::max(in.self.wall() - what.since, duration{});
            rows.add({what.path, std::string(name_of(what.state)), one.host.name, process_of(what),
                      show_duration(length), std::to_string(what.restarts),
                      what.deployment.empty() ? "-" : what.deployment, what.type, remarks(what)});
        }
        constexpr std::size_t for_reason = 30;
        text = rows.text(in.out.width(), {}, {"PROCESS", "TYPE", "RESTARTS", "FOR", "DEPLOYMENT", "HOST"}, for_reason);
    }
    co_await in.out.write(in.self, std::move(text));
    if (all.empty() && !options.names)
        note(in.set, "nothing was started by an instantiation server: ise start --types tells what could be");
}

void declare_ps(command_line::app& app, parsed_command& made) {
    auto given = std::make_shared<ps_options>();
    add_prefix(app, given->prefix);
    add_host(app, given->host);
    app.add_flag("--names", given->names, "only the paths");
    app.callback([&made, given] { made.work = [given](context& in) { return ps(in, *given); }; });
}

} // namespace

extern const command ps_command{"ps", run_group, "lists started components with their state", "  ise ps\n", declare_ps};

} // namespace ise::cli
