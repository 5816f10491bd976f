#include "commands.hpp"

#include "hosts.hpp"
#include "table.hpp"
#include "text.hpp"

#include <fmt/format.h>

namespace ise::cli {
namespace {

namespace host_services = instantiation::services;

task<> tell(context& in, std::string host, instantiation::instance_info what) {
    auto text = in.set.json ? as_json(host, what) : as_sentence(host, what);
    co_await in.out.write(in.self, text + "\n");
}

// "4711", and where others run in it too "4711 (main)".
std::string process_of(const instantiation::instance_info& what) {
    auto text = what.process_id == 0 ? std::string("-") : std::to_string(what.process_id);
    return what.process.empty() ? text : fmt::format("{} ({})", text, what.process);
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

} // namespace

task<> ps(context& in, ps_options options) {
    auto all = co_await instances_there(in, options.host, options.prefix);
    std::string text;
    if (options.names) {
        for (const auto& one : all) text += printable(one.instance.path) + "\n";
    } else if (in.set.json) {
        for (const auto& one : all) text += (text.empty() ? "" : ",") + as_json(one.host.name, one.instance);
        text = "[" + text + "]\n";
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

task<> stop(context& in, instance_options options) {
    auto found = co_await find_instance(in, options.host, options.name);
    instantiation::stop_request request{options.name, options.grace};
    auto told = co_await found.host.server.try_call(host_services::stop, std::move(request), in.left());
    if (!told) throw problem(told.error());
    co_await tell(in, found.host.name, std::move(told->ended));
}

task<> kill(context& in, instance_options options) {
    auto found = co_await find_instance(in, options.host, options.name);
    instantiation::kill_request request{options.name};
    auto told = co_await found.host.server.try_call(host_services::kill, std::move(request), in.left());
    if (!told) throw problem(told.error());
    co_await tell(in, found.host.name, std::move(told->ended));
}

task<> restart(context& in, instance_options options) {
    auto found = co_await find_instance(in, options.host, options.name);
    instantiation::restart_request request{options.name};
    auto told = co_await found.host.server.try_call(host_services::restart, std::move(request), in.left());
    if (!told) throw problem(told.error());
    auto what = started(*told);
    co_await tell(in, found.host.name, std::move(what));
}

} // namespace ise::cli
