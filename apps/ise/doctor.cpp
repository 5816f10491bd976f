// ise doctor: what is wrong with the system, and what to do about it.
#include "call_cycles.hpp"
#include "findings.hpp"
#include "hosts.hpp"
#include "json.hpp"
#include "options.hpp"
#include "survey.hpp"
#include "text.hpp"

#include <ise/core/time_text.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <tuple>

namespace ise::cli {
namespace {

struct doctor_options {
    duration interval = std::chrono::milliseconds(800); ///< between its two looks: it answers within a second
};

struct diagnosis {
    bool healthy = false;
    std::string asked_at;
    std::uint64_t components = 0;
    std::vector<finding> findings;
};

std::string as_text(const std::vector<finding>& found) {
    std::string text;
    for (const auto& one : found) {
        auto message = one.message;
        while (message.ends_with('\n')) message.pop_back();
        text += fmt::format("{:<8} {}{}{}\n", name_of(one.severity), printable(one.component),
                            one.component.empty() ? "" : ": ", printable(message, true));
        text += fmt::format("         -> {}\n", printable(one.advice));
    }
    return text;
}

void examine(const found_instance& of, std::vector<finding>& found) {
    const auto& what = of.instance;
    const auto& host = of.host.name;
    const auto& path = what.path;
    auto add = [&](severity_level severity, const char* kind, std::string message, std::string advice) {
        found.push_back({severity, kind, path, std::move(message), std::move(advice)});
    };
    if (what.state == instantiation::instance_state::failed)
        add(what.deployment.empty() ? severity_level::warning
                                    : severity_level::error, // what was started by hand may not be needed any more
            "failed", fmt::format("it has failed on {} and is not started again: {}", host, what.reason),
            fmt::format("ise logs {0} shows its last output; then ise restart {0}, or ise up, or ise stop {0} if it is "
                        "not needed any more",
                        path));
    if (what.state == instantiation::instance_state::waiting)
        add(severity_level::warning, "waiting",
            fmt::format("it ended on {} and is about to be started again ({} times so far): {}", host, what.restarts,
                        what.reason),
            fmt::format("ise logs {} shows its last output", path));
    if (!what.probe_trouble.empty())
        add(severity_level::error, "probe_failed", fmt::format("it runs on {}, but {}", host, what.probe_trouble),
            fmt::format("ise logs {0} shows its output; ise restart {0} starts it again, and its `restart` policy does "
                        "so by itself",
                        path));
    if (!what.output_trouble.empty())
        add(severity_level::warning, "output_dropped",
            fmt::format("its output on {} is dropped: {}", host, what.output_trouble),
            "make room on the disk of the instantiation server's --state");
    if (what.rebuilt)
        add(severity_level::note, "rebuilt",
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
    auto servers = co_await lost_hosts(in);
    std::vector<finding> found;
    for (const auto& one : servers) {
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

task<std::vector<finding>> examine_store_of_names(context& in) {
    auto server = co_await reach_name_server(in);
    naming::list_request question;
    question.limit = 1;
    auto response = co_await server.try_call(naming::list, std::move(question), in.left());
    std::vector<finding> found;
    if (!response || response->trouble.empty()) co_return found;
    finding store;
    store.kind = "store_of_names";
    store.component = naming::server_path;
    store.message = response->trouble;
    store.advice =
        "etcdctl endpoint status and etcdctl alarm list, with the endpoints of --store, show which member is "
        "away, slow or without space";
    found.push_back(std::move(store));
    co_return found;
}

task<> conclude(context& in, std::vector<finding> found, std::vector<surveyed> all) {
    auto bad = static_cast<std::size_t>(
        std::ranges::count_if(found, [](const finding& one) { return one.severity != severity_level::note; }));
    std::string text;
    if (in.set.json) {
        diagnosis result{bad == 0, iso_8601(in.self.wall()), all.size(), std::move(found)};
        text = json_line(result);
    } else {
        text = as_text(found);
        if (bad == 0) text += all.empty() ? "nothing is wrong: no component is registered\n" : "nothing is wrong\n";
        text += show_age(in, all);
    }
    co_await in.out.write(in.self, std::move(text));
    if (bad > 0) throw problem(exit_code::failed, "findings", fmt::format("{} finding{}", bad, bad == 1 ? "" : "s"));
}

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
        auto cycles = examine_calls(now);
        found.insert(found.end(), cycles.begin(), cycles.end());
        auto lost = co_await examine_lost_servers(in);
        found.insert(found.end(), lost.begin(), lost.end());
        auto store = co_await examine_store_of_names(in);
        found.insert(found.end(), store.begin(), store.end());
        auto ended = co_await examine_instances(in);
        found.insert(found.end(), ended.begin(), ended.end());
        std::ranges::stable_sort(found, {}, [](const finding& one) { return std::tie(one.severity, one.component); });
    } catch (const problem& why) {
        if (why.code() != exit_code::not_reached) throw;
        bool answers = has_unusable_policy(why.what());
        finding lost{severity_level::error, answers ? "policy_unusable" : "no_name_server",
                     answers ? std::string(naming::server_path) : std::string(), why.what(), why.advice()};
        found.push_back(std::move(lost));
    }
    co_await conclude(in, std::move(found), std::move(now));
}

void declare_doctor(command_line::app& app, parsed_command& made) {
    auto given = std::make_shared<doctor_options>();
    add_time(app, "--interval", given->interval, "time between its two inspections (default: 800ms)");
    app.callback([&made, given] {
        made.looks = true;
        made.work = [given](context& in) { return doctor(in, *given); };
    });
}

} // namespace

extern const command doctor_command{
    "doctor", measure_group, "finds problems and remedies; exit code 1 if there are any",
    "  ise doctor\n  ise doctor && echo healthy               exit code 1: something is wrong\n", declare_doctor};

} // namespace ise::cli
