// ise start: starts a component by the instantiation server of a host, or lists what could be started.
#include "hosts.hpp"
#include "json.hpp"
#include "options.hpp"
#include "text.hpp"

#include <ise/component/component_type.hpp>
#include <ise/core/transport.hpp>
#include <ise/packet/json.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <memory>

namespace ise::cli {
namespace {

struct start_options {
    std::string type, name, host, name_space, protocol;
    std::vector<std::string> set, listen, variables, roles, limits;
    std::string process; ///< that it shares with others; empty: it has one to itself
    std::string identity, user;
    std::string policy = "never";
    instantiation::restart_terms terms;
    bool types = false; ///< tell what could be started instead
    bool names = false; ///< nothing but their names
};

struct startable_type {
    std::string host, type, description, path, program;
    std::vector<json_text> parameters;
    std::vector<type_service> services;
    std::vector<std::string> variables;
};

startable_type startable(const std::string& host, const instantiation::catalogue_type& type) {
    const auto& about = type.about;
    startable_type made{host,         about.name, about.description, about.path,
                        type.program, {},         about.services,    about.variables};
    for (const auto& one : about.parameters) made.parameters.push_back({ise::to_json(one)});
    return made;
}

std::string type_page(const std::string& host, const instantiation::catalogue_type& type, std::size_t width) {
    const auto& about = type.about;
    auto text = printable(fmt::format("{}  {} ({} on {})", about.name, about.description, type.program, host)) + "\n";
    std::string provided, required;
    for (const auto& one : about.services) (one.provided ? provided : required) += " " + printable(one.name);
    if (!about.path.empty()) text += fmt::format("  path      {}\n", printable(about.path));
    if (!provided.empty()) text += fmt::format("  provides {}\n", provided);
    if (!required.empty()) text += fmt::format("  requires {}\n", required);
    for (const auto& one : about.variables) text += fmt::format("  reads     {}\n", printable(one));
    std::size_t column = 10;
    for (const auto& one : about.parameters) column = std::max(column, std::min<std::size_t>(columns(one.name), 25));
    if (!about.parameters.empty()) text += "  parameters\n";
    for (const auto& one : about.parameters)
        text += printable(fmt::format("    {:<{}}  {}: {}{} (default: {})", one.name, column, one.description,
                                      allowed_values(one), one.changeable ? "; also while it runs" : "",
                                      one.preset.empty() ? "none" : one.preset)) +
                "\n";
    return (width == 0 ? text : wrapped(text, width)) + "\n";
}

task<> show_types(context& in, start_options options) {
    auto hosts = co_await hosts_there(in, options.host);
    std::string text;
    std::vector<startable_type> listed;
    std::vector<std::string> known;
    bool found = false;
    for (auto& host : hosts) {
        instantiation::types_request question;
        auto response = co_await host.server.try_call(instantiation::services::types, question, in.left());
        if (!response) throw problem(response.error());
        for (const auto& type : response->types) {
            known.push_back(type.about.name);
            if (!options.type.empty() && type.about.name != options.type) continue;
            found = true;
            if (options.names) text += printable(type.about.name) + "\n";
            else if (in.set.json) listed.push_back(startable(host.name, type));
            else text += type_page(host.name, type, in.out.width());
        }
        for (const auto& trouble : response->problems)
            if (!options.names && options.type.empty()) note(in.set, fmt::format("{}: {}", host.name, trouble));
    }
    if (!options.type.empty() && !found) {
        auto near = nearest(options.type, known);
        throw problem(exit_code::not_reached, "no_such_name",
                      fmt::format("no host has a component type '{}'", options.type),
                      near.empty() ? "" : fmt::format("did you mean '{}'?", near.front()));
    }
    if (in.set.json && !options.names) text = json_line(listed);
    co_await in.out.write(in.self, std::move(text));
}

task<> start(context& in, start_options options) {
    if (options.types) {
        co_await show_types(in, options);
        co_return;
    }
    if (options.type.empty())
        throw problem(exit_code::usage, "usage", "which type is to be started?", "ise start --types lists the types");
    instantiation::start_request request;
    request.type = options.type;
    request.path = options.name;
    request.name_space = options.name_space;
    request.listen = options.listen;
    request.protocol = options.protocol;
    request.process = options.process;
    request.identity = options.identity;
    request.user = options.user;
    request.terms = options.terms;
    for (const auto& text : options.set) {
        auto [name, value] = name_and_value(text, "--set");
        request.arguments.push_back({name, value});
    }
    for (const auto& text : options.variables) {
        auto [name, value] = name_and_value(text, "--env");
        request.variables.push_back({name, value});
    }
    for (const auto& text : options.limits) {
        auto [name, value] = name_and_value(text, "--limit");
        auto set = instantiation::set_limit(request.limits, name, value);
        if (!set) throw problem(exit_code::usage, "usage", set.error().message());
    }
    for (const auto& text : options.roles) {
        auto role = parse_role(text);
        if (!role) throw problem(role.error());
        request.roles.insert(std::move(*role));
    }
    auto host = co_await host_to_use(in, options.host);
    auto response = co_await host.server.try_call(instantiation::services::start, std::move(request), in.left());
    if (!response) throw problem(response.error());
    auto what = started(*response);
    co_await print_instance(in, host.name, std::move(what));
}

instantiation::restart_policy policy_of(const std::string& name) {
    using enum instantiation::restart_policy;
    return name == "always" ? always : name == "on-failure" ? on_failure : never;
}

void declare_start(command_line::app& app, parsed_command& made) {
    auto given = std::make_shared<start_options>();
    app.add_option("TYPE", given->type, "type of the component: ise start --types");
    app.add_option("PATH", given->name, "its path (default: that of the type)");
    app.add_option("--host", given->host, "name of the host (default: the only one, or this one)")->type_name("HOST");
    add_each(app, "--set,-s", given->set, "a parameter of the type; several are allowed");
    app.add_option("--namespace", given->name_space, "prefix of its path")->type_name("PREFIX");
    auto* listen = add_each(app, "--listen", given->listen,
                            "endpoint to listen on (default: in-process, shared memory, a local socket and a port of "
                            "the loopback interface)",
                            "ENDPOINT");
    app.add_option("--protocol", given->protocol, "listen on any endpoint of that kind")
        ->check(one_of(schemes_between_processes()))
        ->excludes(listen);
    add_each(app, "--env", given->variables, "an environment variable that the type reads");
    add_each(app, "--role", given->roles, "a role to serve, with its priority; several are allowed", "ROLE=PRIORITY");
    app.add_option("--identity", given->identity,
                   "certificates of its own, by the name of their folder on the host (default: those of the host)")
        ->type_name("NAME");
    app.add_option("--user", given->user,
                   "user of the host that it runs as (default: that of the instantiation server)")
        ->type_name("NAME");
    app.add_option("--process", given->process,
                   "a process shared with other components of its program, each on a thread of its own (default: a "
                   "process of its own)")
        ->type_name("NAME");
    add_each(app, "--limit", given->limits,
             "a resource limit for it and the processes that it starts: pids=64, memory=256MiB or cpus=0.5; "
             "several are allowed (default: pids=256)");
    app.add_option("--restart", given->policy, "whether it is restarted when it ends (default: never)")
        ->check(one_of({"never", "on-failure", "always"}))
        ->default_str("never");
    app.add_option("--restarts", given->terms.limit,
                   "maximum restarts within a minute, 0 to 1000; beyond, it has failed (default: 5)")
        ->check(command_line::range(0u, 1000u))
        ->type_name("N");
    add_time(app, "--ready-within", given->terms.ready_within, "time limit of the start (default: 10s)");
    add_time(app, "--grace", given->terms.grace, "between SIGTERM and SIGKILL when it is stopped (default: 5s)");
    app.add_flag("--types", given->types, "list the types that can be started, or show TYPE");
    app.add_flag("--names", given->names, "with --types: only the names");
    app.callback([&made, given] {
        given->terms.policy = policy_of(given->policy);
        made.patience = given->terms.ready_within + besides_own_terms;
        made.work = [given](context& in) { return start(in, *given); };
    });
}

} // namespace

extern const command start_command{"start", run_group, "starts a component, and waits until it is ready",
                                   "  ise start --types                        what can be started\n"
                                   "  ise start --types wind                   its parameters\n"
                                   "  ise start wind sea/wind --set speed=8\n",
                                   declare_start};

} // namespace ise::cli
