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
        text += fmt::format("{:<8} {}{}{}\n", name_of(one.weight), printable(one.component), one.component.empty() ? "" : ": ", printable(message, true));
        text += fmt::format("         -> {}\n", printable(one.advice));
    }
    return text;
}

finding given_up(const found_instance& of) {
    const auto& what = of.instance;
    finding made;
    made.weight = what.deployment.empty() ? severity::warning : severity::error; // what was started by hand may not be needed any more
    made.kind = "failed";
    made.component = what.path;
    made.message = fmt::format("it has failed on {} and is not started again: {}", of.host.name, what.reason);
    made.advice = fmt::format("ise logs {0} tells what it printed last; then ise restart {0}, or ise up, or ise stop {0} if it is not needed any more", what.path);
    return made;
}

finding coming_again(const found_instance& of) {
    finding made;
    made.weight = severity::warning;
    made.kind = "waiting";
    made.component = of.instance.path;
    made.message = fmt::format("it ended on {} and is about to be started again ({} times so far): {}", of.host.name, of.instance.restarts, of.instance.reason);
    made.advice = fmt::format("ise logs {} tells what it printed last", of.instance.path);
    return made;
}

finding fails_probe(const found_instance& of) {
    finding made;
    made.weight = severity::error;
    made.kind = "probe_failed";
    made.component = of.instance.path;
    made.message = fmt::format("it runs on {}, but {}", of.host.name, of.instance.probe_trouble);
    made.advice = fmt::format("ise logs {0} tells what it prints; ise restart {0} starts it again, and its `restart` policy does so by itself", of.instance.path);
    return made;
}

finding loses_output(const found_instance& of) {
    finding made;
    made.weight = severity::warning;
    made.kind = "output_dropped";
    made.component = of.instance.path;
    made.message = fmt::format("what it prints on {} is not kept: {}", of.host.name, of.instance.output_trouble);
    made.advice = "make room on the disk of the instantiation server's --state";
    return made;
}

finding of_before(const found_instance& of) {
    finding made;
    made.weight = severity::note;
    made.kind = "rebuilt";
    made.component = of.instance.path;
    made.message = fmt::format("it runs a program that was rebuilt on {} since it was started", of.host.name);
    made.advice = of.instance.process.empty() ? fmt::format("ise up, or ise restart {}", of.instance.path) : std::string("ise up, which starts its process again with all that runs in it");
    return made;
}

// Of what does not run nobody is registered who could be asked.
task<std::vector<finding>> examine_instances(context& in) {
    std::vector<found_instance> all;
    try {
        all = co_await instances_there(in, "", "");
    } catch (const problem&) { // none is there to have started anything, or it was found not to answer already
    }
    std::vector<finding> found;
    for (const auto& one : all) {
        if (one.instance.state == instantiation::instance_state::failed) found.push_back(given_up(one));
        if (one.instance.state == instantiation::instance_state::waiting) found.push_back(coming_again(one));
        if (!one.instance.probe_trouble.empty()) found.push_back(fails_probe(one));
        if (!one.instance.output_trouble.empty()) found.push_back(loses_output(one));
        if (one.instance.rebuilt) found.push_back(of_before(one));
    }
    co_return found;
}

task<> conclude(context& in, std::vector<finding> found, std::vector<surveyed> all) {
    auto bad = static_cast<std::size_t>(std::ranges::count_if(found, [](const finding& one) { return one.weight != severity::note; }));
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
