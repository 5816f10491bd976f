#include "look.hpp"

#include "findings.hpp"
#include "hosts.hpp"
#include "survey.hpp"
#include "text.hpp"

#include <nlohmann/json.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <tuple>

namespace ise::cli {
namespace {

using nlohmann::ordered_json;

std::string as_json(const std::vector<finding>& found, std::size_t components, bool healthy, wall_time at) {
    ordered_json told;
    told["healthy"] = healthy;
    told["asked_at"] = show_wall(at);
    told["components"] = components;
    auto all = ordered_json::array();
    for (const auto& one : found) {
        ordered_json entry;
        entry["severity"] = name_of(one.weight);
        entry["kind"] = one.kind;
        entry["component"] = one.component;
        entry["message"] = one.message;
        entry["advice"] = one.advice;
        all.push_back(std::move(entry));
    }
    told["findings"] = std::move(all);
    return told.dump(-1, ' ', false, ordered_json::error_handler_t::replace) + "\n";
}

std::string as_text(const std::vector<finding>& found) {
    std::string text;
    for (const auto& one : found) {
        auto message = one.message;
        while (message.ends_with('\n')) message.pop_back();
        text += fmt::format("{:<8} {}{}{}\n", name_of(one.weight), printable(one.component),
                            one.component.empty() ? "" : ": ", printable(message, true));
        text += fmt::format("         -> {}\n", printable(one.advice));
    }
    return text;
}

void examine(const found_instance& of, std::vector<finding>& found) {
    const auto& what = of.instance;
    const auto& host = of.host.name;
    const auto& path = what.path;
    auto add = [&](severity weight, const char* kind, std::string message, std::string advice) {
        found.push_back({weight, kind, path, std::move(message), std::move(advice)});
    };
    if (what.state == instantiation::instance_state::failed)
        add(what.deployment.empty() ? severity::warning
                                    : severity::error, // what was started by hand may not be needed any more
            "failed", fmt::format("it has failed on {} and is not started again: {}", host, what.reason),
            fmt::format("ise logs {0} shows its last output; then ise restart {0}, or ise up, or ise stop {0} if it is "
                        "not needed any more",
                        path));
    if (what.state == instantiation::instance_state::waiting)
        add(severity::warning, "waiting",
            fmt::format("it ended on {} and is about to be started again ({} times so far): {}", host, what.restarts,
                        what.reason),
            fmt::format("ise logs {} shows its last output", path));
    if (!what.probe_trouble.empty())
        add(severity::error, "probe_failed", fmt::format("it runs on {}, but {}", host, what.probe_trouble),
            fmt::format("ise logs {0} shows its output; ise restart {0} starts it again, and its `restart` policy does "
                        "so by itself",
                        path));
    if (!what.output_trouble.empty())
        add(severity::warning, "output_dropped",
            fmt::format("its output on {} is dropped: {}", host, what.output_trouble),
            "make room on the disk of the instantiation server's --state");
    if (what.rebuilt)
        add(severity::note, "rebuilt",
            fmt::format("it runs a program that was rebuilt on {} since it was started", host),
            what.process.empty() ? fmt::format("ise up, or ise restart {}", path)
                                 : std::string("ise up, which starts its process again with all that runs in it"));
}

// Of what does not run nobody is registered who could be asked.
task<std::vector<finding>> examine_instances(context& in) {
    std::vector<found_instance> all;
    try {
        all = co_await instances_there(in, "", "");
    } catch (const problem&) { // none is there to have started anything, or it was found not to answer already
    }
    std::vector<finding> found;
    for (const auto& one : all) examine(one, found);
    co_return found;
}

// A server that was killed cannot tell what it had started; the name server knows that it was there.
task<std::vector<finding>> examine_lost_servers(context& in) {
    auto names = co_await reach_name_server(in);
    naming::lost_request question;
    question.prefix = instantiation::hosts_path;
    auto told = co_await names.try_call(naming::lost, std::move(question), in.left());
    std::vector<finding> found;
    if (!told) co_return found; // an older one does not know
    for (const auto& one : told->names) {
        auto host = one.path.substr(one.path.rfind('/') + 1);
        finding lost;
        lost.kind = "server_lost";
        lost.component = one.path;
        lost.message = fmt::format("the instantiation server was lost {} ago without being stopped (process {} on {}): "
                                   "what it had started is not watched over, and `ise ps` does not show it",
                                   show_duration(one.lost_ago), one.process_id, one.host_name);
        lost.advice = fmt::format("start it again with the same --state and --name {}: it takes over what still runs; "
                                  "where it is not needed any more, stop it then",
                                  host);
        found.push_back(std::move(lost));
    }
    co_return found;
}

task<> conclude(context& in, std::vector<finding> found, std::vector<surveyed> all) {
    auto bad = static_cast<std::size_t>(
        std::ranges::count_if(found, [](const finding& one) { return one.weight != severity::note; }));
    std::string text;
    if (in.set.json) {
        text = as_json(found, all.size(), bad == 0, in.self.wall());
    } else {
        text = as_text(found);
        if (bad == 0) text += all.empty() ? "nothing is wrong: no component is registered\n" : "nothing is wrong\n";
        text += show_age(in, all);
    }
    co_await in.out.write(in.self, std::move(text));
    if (bad > 0) throw problem(exit_code::failed, "findings", fmt::format("{} finding{}", bad, bad == 1 ? "" : "s"));
}

} // namespace

task<> doctor(context& in, doctor_options options) {
    survey_options what;
    what.leases = true;
    std::vector<surveyed> before, now;
    std::vector<finding> found;
    try {
        before = co_await survey(in, what);
        co_await in.self.sleep(options.interval);
        in.until = saturating_add(in.self.now(), in.set.timeout);
        now = co_await survey(in, what);
        found = examine(before, now, options.interval, in.self.env().identity().host_name);
        auto lost = co_await examine_lost_servers(in);
        found.insert(found.end(), lost.begin(), lost.end());
        auto ended = co_await examine_instances(in);
        found.insert(found.end(), ended.begin(), ended.end());
        std::ranges::stable_sort(found, {}, [](const finding& one) { return std::tie(one.weight, one.component); });
    } catch (const problem& why) {
        if (why.code() != exit_code::not_reached) throw;
        finding lost{severity::error, "no_name_server", {}, why.what(), why.advice()};
        found.push_back(std::move(lost));
    }
    co_await conclude(in, std::move(found), std::move(now));
}

} // namespace ise::cli
