#include "hosts.hpp"

#include "json.hpp"
#include "options.hpp"
#include "text.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace ise::cli {
namespace {

using namespace std::chrono_literals;
using instantiation::hosts_path;

std::string host_name_of(const std::string& path) {
    return path.size() > hosts_path.size() ? path.substr(hosts_path.size() + 1) : path;
}

std::vector<std::string> names_of(const std::vector<naming::listed_name>& listed) {
    std::vector<std::string> names;
    for (const auto& one : listed) names.push_back(host_name_of(one.path));
    return names;
}

bool has_host(const std::vector<naming::listed_name>& listed, const std::string& name) {
    return std::ranges::any_of(listed, [&](const auto& one) { return name.empty() || host_name_of(one.path) == name; });
}

// A name server that has just started learns from those who are there; until then it knows a part of the system only.
task<bool> still_learns(context& in) {
    auto server = co_await reach_name_server(in);
    naming::resolve_request question{std::string(hosts_path)}; // which nobody is called
    auto response = co_await server.try_call(naming::resolve, std::move(question), in.left());
    co_return !response && response.error().code() == errc::name_server_lost;
}

task<std::vector<naming::listed_name>> listed_hosts(context& in) {
    constexpr duration look_again = 100ms, until_newcomers_ask_again = 300ms;
    auto learns = co_await still_learns(in);
    if (learns) note(in.set, "the name server has just started: it is asked again when it knows the components");
    bool learned = learns;
    while (learns && in.left() > look_again + until_newcomers_ask_again) {
        co_await in.self.sleep(look_again);
        learns = co_await still_learns(in);
    }
    if (learned) co_await in.self.sleep(std::min(in.left(), until_newcomers_ask_again));
    auto listed = co_await listed_names(in, std::string(hosts_path));
    co_return listed;
}

// "atirma/boat is ready on shore, as process 4711"
std::string as_sentence(const std::string& host, const instantiation::instance_info& what) {
    auto text = fmt::format("{} is {} on {}", what.path, name_of(what.state), host);
    if (what.process_id != 0) text += fmt::format(", as process {}", what.process_id);
    if (!what.reason.empty()) text += fmt::format(": {}", what.reason);
    return printable(text);
}

} // namespace

task<std::vector<host_server>> hosts_there(context& in, std::string name) {
    constexpr duration look_again = 100ms;
    auto listed = co_await listed_hosts(in);
    while (in.set.wait && !has_host(listed, name) && in.left() > look_again) { // one that is just starting
        co_await in.self.sleep(look_again);
        listed = co_await listed_names(in, std::string(hosts_path));
    }
    if (listed.empty())
        throw problem(exit_code::not_reached, "no_such_name", "no instantiation server is registered",
                      "start one on each host: ise_instantiation_server --programs FOLDER");
    std::vector<host_server> found;
    for (const auto& one : listed)
        if (name.empty() || host_name_of(one.path) == name)
            found.push_back({host_name_of(one.path), in.self.at(one.path)});
    if (found.empty())
        throw problem(exit_code::not_reached, "no_such_name",
                      fmt::format("there is no instantiation server '{}'", name),
                      fmt::format("there are {}", enumerate(names_of(listed))));
    co_return found;
}

task<host_server> host_to_use(context& in, std::string name) {
    auto there = co_await hosts_there(in, name);
    auto listed = co_await listed_names(in, std::string(hosts_path));
    if (there.size() == 1) co_return there.front();
    std::vector<std::string> mine;
    for (const auto& one : listed)
        if (one.host_name == in.self.env().identity().host_name) mine.push_back(one.path);
    if (mine.size() != 1)
        throw problem(exit_code::usage, "usage", "there is more than one instantiation server",
                      fmt::format("choose one with --host: {}", enumerate(names_of(listed))));
    host_server made{host_name_of(mine.front()), in.self.at(mine.front())};
    co_return made;
}

task<result<std::vector<instantiation::instance_info>>> instances_of(context& in, host_server of, std::string prefix) {
    instantiation::instances_request question{std::move(prefix)};
    auto response = co_await of.server.try_call(instantiation::services::instances, std::move(question),
                                                std::min(in.left(), duration(3s)));
    if (!response) co_return response.error();
    co_return std::move(response->instances);
}

task<std::vector<naming::lost_name>> lost_hosts(context& in) {
    auto names = co_await reach_name_server(in);
    naming::lost_request question;
    question.prefix = hosts_path;
    auto response = co_await names.try_call(naming::lost, std::move(question), in.left());
    if (!response) co_return std::vector<naming::lost_name>(); // an older one does not know
    co_return std::move(response->names);
}

task<std::vector<found_instance>> instances_there(context& in, std::string host, std::string prefix) {
    auto hosts = co_await hosts_there(in, host);
    std::vector<found_instance> all;
    for (auto& one : hosts) {
        auto started = co_await instances_of(in, one, prefix);
        if (!started) {
            if (hosts.size() == 1) throw problem(started.error());
            note(in.set, fmt::format("{} does not answer: {}", one.name, started.error().message()));
            continue;
        }
        for (auto& instance : *started) all.push_back({one, std::move(instance)});
    }
    co_return all;
}

task<found_instance> find_instance(context& in, std::string host, std::string path) {
    auto all = co_await instances_there(in, host, "");
    std::vector<found_instance> found;
    std::vector<std::string> known;
    for (auto& one : all) {
        known.push_back(one.instance.path);
        if (one.instance.path == path) found.push_back(std::move(one));
    }
    if (found.size() == 1) co_return std::move(found.front());
    if (found.size() > 1) {
        // What still runs there is meant, rather than what is over elsewhere.
        std::erase_if(found, [](const auto& one) { return one.instance.process_id == 0; });
        if (found.size() == 1) co_return std::move(found.front());
        throw problem(exit_code::usage, "usage", fmt::format("several hosts have started '{}'", path),
                      "choose one with --host");
    }
    auto near = nearest(path, known);
    auto advice = near.empty() ? fmt::format("{} instances are known: ise ps", known.size())
                               : fmt::format("did you mean '{}'?", near.front());
    auto why = fmt::format("no instantiation server has started '{}'", path);
    for (const auto& other : co_await listed_names(in, path)) {
        if (other.path != path) continue;
        why =
            fmt::format("'{}' runs as process {} on {}, but no instantiation server that is registered has started it",
                        path, other.process_id, other.host_name);
        advice = "one that was killed takes it over when it is started again with the same --state; else end the "
                 "process there";
    }
    throw problem(exit_code::not_reached, "no_such_name", why, advice);
}

instantiation::instance_info started(const instantiation::start_response& result) {
    using enum instantiation::start_outcome;
    auto fail = [&](exit_code code, const char* name, const std::string& advice = {}) {
        auto why = result.why;
        if (result.outcome == exited || result.outcome == deadline)
            why += result.output.empty() ? "; it printed nothing"
                                         : fmt::format("; the last that it printed:\n{}", result.output);
        throw problem(code, name, why, advice);
    };
    switch (result.outcome) {
        case ready: return result.started;
        case no_such_type: fail(exit_code::usage, "no_such_type"); break;
        case bad_argument:
            fail(exit_code::usage, "bad_argument", "ise start --types TYPE shows the allowed values");
            break;
        case name_taken: fail(exit_code::failed, "name_taken", "ise list shows its holder"); break;
        case address_in_use: fail(exit_code::failed, "address_in_use"); break;
        case too_many: fail(exit_code::failed, "too_many"); break;
        case name_server_lost: fail(exit_code::not_reached, "name_server_lost"); break;
        case not_launched: fail(exit_code::failed, "not_launched"); break;
        case exited: fail(exit_code::failed, "exited"); break;
        case deadline: fail(exit_code::not_reached, "deadline"); break;
    }
    fail(exit_code::failed, "unknown_outcome"); // of a newer server
    return {};
}

std::string_view name_of(instantiation::instance_state state) {
    using enum instantiation::instance_state;
    switch (state) {
        case starting: return "starting";
        case ready: return "ready";
        case stopping: return "stopping";
        case waiting: return "waiting";
        case stopped: return "stopped";
        case failed: return "failed";
    }
    return "?";
}

instance_line line_of(const std::string& host, const instantiation::instance_info& what) {
    return {.host = host,
            .path = what.path,
            .type = what.type,
            .program = what.program,
            .state = name_of(what.state),
            .reason = what.reason,
            .process_id = what.process_id,
            .process = what.process,
            .since_s = what.since.time_since_epoch(),
            .restarts = what.restarts,
            .adopted = what.adopted,
            .arguments = what.arguments,
            .roles = what.roles,
            .deployment = what.deployment,
            .limits = what.limits,
            .output_dropped = what.output_dropped,
            .output_trouble = what.output_trouble,
            .probe = what.terms.probe,
            .probe_trouble = what.probe_trouble,
            .rebuilt = what.rebuilt,
            .identity = what.identity,
            .user = what.user};
}

task<> print_instance(context& in, std::string host, instantiation::instance_info what) {
    std::string text;
    if (in.set.json) text = json_line(line_of(host, what));
    else text = as_sentence(host, what) + "\n";
    co_await in.out.write(in.self, std::move(text));
}

void add_host(command_line::app& app, std::string& host) {
    app.add_option("--host", host, "name of the host (default: the one that runs it)")->type_name("HOST");
}

} // namespace ise::cli
