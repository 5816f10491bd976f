#include "deployments.hpp"

#include "options.hpp"
#include "text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <set>

namespace ise::cli {
namespace {

using namespace std::chrono_literals;
using instantiation::instance_state;

constexpr std::size_t max_file_bytes = 1 << 20;
constexpr duration one_answer = 10s;
constexpr duration max_settling = 60s;
constexpr duration max_check = 60s;

std::set<std::string> servers_used(const deployment::deployment& of) {
    std::set<std::string> used;
    for (const auto& one : of.components)
        if (const auto* host = of.host(one.host.text)) used.insert(host->server);
    return used;
}

bool unsettled(const deployment::deployment& of, const std::vector<deployment::host_state>& hosts) {
    for (const auto& host : hosts)
        for (const auto& one : host.instances)
            if (one.deployment == of.name.text &&
                (one.state == instance_state::starting || one.state == instance_state::stopping))
                return true;
    return false;
}

deployment::wanted_host& host_of(deployment::deployment& of, const std::string& name) {
    std::vector<std::string> names;
    for (auto& one : of.hosts) {
        if (one.name.text == name) return one;
        names.push_back(one.name.text);
    }
    throw problem(exit_code::usage, "usage",
                  fmt::format("--move-from: the file has no host '{}'; there {} {}", printable(name),
                              names.size() == 1 ? "is" : "are", fmt::join(names, ", ")));
}

/// HOST=OTHER: the instantiation server of OTHER takes the components of HOST, and that of HOST is not asked.
void move_host(deployment::deployment& of, const std::string& text) {
    auto [from, to] = name_and_value(text, "--move-from", "HOST=OTHER");
    auto server = host_of(of, to).server;
    host_of(of, from).server = std::move(server);
}

task<result<deployment::host_state>> ask_host(context& in, host_server host) {
    deployment::host_state made;
    made.server = host.name;
    instantiation::types_request what;
    auto types = co_await host.server.try_call(instantiation::services::types, what, std::min(in.left(), one_answer));
    if (!types) co_return types.error();
    made.types = std::move(types->types);
    instantiation::instances_request all;
    auto instances = co_await host.server.try_call(instantiation::services::instances, std::move(all),
                                                   std::min(in.left(), one_answer));
    if (!instances) co_return instances.error();
    made.instances = std::move(instances->instances);
    co_return made;
}

} // namespace

deployment::reading read_what_there_is(context& in, const deployment_options& options) {
    return read_what_there_is(in.self.env(), options);
}

deployment::reading read_what_there_is(environment& env, const deployment_options& options) {
    deployment::settings given;
    for (const auto& text : options.set) given.push_back(name_and_value(text, "--set"));
    auto read = [&](const std::string& path) { return env.read_file(path, max_file_bytes); };
    auto parsed = deployment::read_deployment(options.file, read, given);
    if (parsed.problems.empty())
        for (const auto& text : options.move) move_host(parsed.made, text);
    return parsed;
}

deployment::deployment read_file(context& in, const deployment_options& options) {
    auto parsed = read_what_there_is(in, options);
    refuse(options.file, parsed.problems);
    return std::move(parsed.made);
}

void refuse(const std::string& file, const std::vector<deployment::problem>& problems) {
    if (problems.empty()) return;
    constexpr std::size_t most = 20;
    auto text = fmt::format("{} cannot be used as it is:", file);
    for (std::size_t at = 0; at < std::min(problems.size(), most); ++at)
        text += fmt::format("\n{}", problems[at].text());
    if (problems.size() > most) text += fmt::format("\n… and {} more", problems.size() - most);
    throw problem(exit_code::usage, "bad_deployment", text);
}

task<fleet> ask_hosts(context& in, const deployment::deployment& of, bool settled) {
    auto used = servers_used(of);
    auto until = saturating_add(in.self.now(), max_settling);
    for (;;) {
        fleet made;
        auto there = co_await hosts_there(in, "");
        for (auto& host : there) {
            auto response = co_await ask_host(in, host);
            if (response) {
                made.hosts.push_back(std::move(*response));
                made.servers.emplace(host.name, host.server);
            } else if (used.contains(host.name)) {
                throw problem(
                    failure(response.error().code(), fmt::format("the instantiation server {} does not answer: {}",
                                                                 host.name, response.error().message())));
            } else {
                note(in.set, fmt::format("{} does not answer, and what runs there is not known: {}", host.name,
                                         response.error().message()));
            }
        }
        bool wait = settled && unsettled(of, made.hosts) && in.self.now() < until;
        if (!wait) co_return made;
        co_await in.self.sleep(200ms);
    }
}

task<> check_starts(context& in, const deployment::deployment& wanted, fleet& of) {
    for (auto& host : of.hosts) {
        instantiation::checks_request request;
        for (const auto& one : wanted.components)
            if (deployment::state_of(wanted, one.host.text, of.hosts) == &host) request.wanted.push_back(one.request);
        if (request.wanted.empty()) continue;
        std::vector<std::string> paths;
        for (const auto& one : request.wanted) paths.push_back(one.path);
        auto server = of.servers.at(host.server);
        auto response = co_await server.try_call(instantiation::services::check, std::move(request),
                                                 std::min(in.left(), max_check));
        if (!response)
            throw problem(
                failure(response.error().code(),
                        fmt::format("the instantiation server {} does not say whether this can be started: {}",
                                    host.server, response.error().message())));
        for (std::size_t at = 0; at < std::min(paths.size(), response->checked.size()); ++at)
            host.checked[paths[at]] = std::move(response->checked[at]);
    }
}

void add_file(command_line::app& app, deployment_options& into) {
    app.add_option("FILE", into.file, "a deployment file (docs/deployment.md)")->required();
    add_each(app, "--set,-s", into.set, "a variable of the file; several are allowed");
    add_each(app, "--move-from", into.move, "HOST is gone for good: its components run on OTHER; several are allowed",
             "HOST=OTHER");
}

} // namespace ise::cli
