#include "instance_commands.hpp"

#include "arguments.hpp"

#include <CLI/CLI.hpp>

namespace ise::cli {
namespace {

using namespace std::chrono_literals;

// Beside what a component may take by its own terms: a name that has to come free, and the way there and back.
constexpr duration besides = 15s;

instantiation::restart_policy policy_of(const std::string& name) {
    using enum instantiation::restart_policy;
    return name == "always" ? always : name == "on-failure" ? on_failure : never;
}

void add_host(CLI::App& to, std::string& host) {
    to.add_option("--host", host, "name of the host (default: the one that runs it)")->type_name("HOST");
}

void add_start(CLI::App& app, instance_places& to, wish& made) {
    auto& into = to.start;
    auto* command = app.add_subcommand("start", "starts a component, and waits until it is ready");
    command->add_option("TYPE", into.type, "type of the component: ise start --types");
    command->add_option("PATH", into.name, "its path (default: that of the type)");
    command->add_option("--host", into.host, "name of the host (default: the only one, or this one)")
        ->type_name("HOST");
    command->add_option("--set,-s", into.set, "a parameter of the type; several are allowed")
        ->type_name("NAME=VALUE")
        ->allow_extra_args(false);
    command->add_option("--namespace", into.name_space, "prefix of its path")->type_name("PREFIX");
    auto* listen =
        command->add_option("--listen", into.listen, "endpoint to listen on (default: in-process, local and loopback)")
            ->type_name("ENDPOINT")
            ->allow_extra_args(false);
    command->add_option("--protocol", into.protocol, "listen on any endpoint of that kind")
        ->check(one_of(schemes_between_processes()))
        ->excludes(listen);
    command->add_option("--env", into.variables, "an environment variable that the type reads")
        ->type_name("NAME=VALUE")
        ->allow_extra_args(false);
    command->add_option("--role", into.roles, "a role to serve, with its priority; several are allowed")
        ->type_name("ROLE=PRIORITY")
        ->allow_extra_args(false);
    command
        ->add_option("--process", into.process,
                     "a process shared with other components of its program, each on a thread of its own (default: a "
                     "process of its own)")
        ->type_name("NAME");
    command
        ->add_option("--limit", into.limits,
                     "a resource limit for it and the processes that it starts: pids=64, memory=256MiB or cpus=0.5; "
                     "several are allowed (default: pids=256)")
        ->type_name("NAME=VALUE")
        ->allow_extra_args(false);
    command->add_option("--restart", to.policy, "whether it is restarted when it ends (default: never)")
        ->check(one_of({"never", "on-failure", "always"}))
        ->default_str("never");
    command
        ->add_option("--restarts", into.terms.limit,
                     "maximum restarts within a minute, 0 to 1000; beyond, it has failed (default: 5)")
        ->check(CLI::Range(0u, 1000u))
        ->type_name("N");
    command->add_option("--ready-within", to.ready_within, "time limit of the start (default: 10s)")->type_name("TIME");
    command->add_option("--grace", to.grace, "between SIGTERM and SIGKILL when it is stopped (default: 5s)")
        ->type_name("TIME");
    command->add_flag("--types", into.types, "list the types that can be started, or show TYPE");
    command->add_flag("--names", into.names, "with --types: only the names");
    command->callback([&to, &made] {
        auto& terms = to.start.terms;
        terms.policy = policy_of(to.policy);
        if (!to.ready_within.empty()) terms.ready_within = positive_time(to.ready_within, "--ready-within");
        if (!to.grace.empty()) terms.grace = positive_time(to.grace, "--grace");
        to.patience = terms.ready_within + besides;
        made.talk.body = [options = to.start](context& in) { return start(in, options); };
    });
}

void add_for_one(CLI::App& app, instance_places& to, wish& made, const std::string& name, const std::string& what,
                 task<> (*act)(context&, instance_options)) {
    auto* command = app.add_subcommand(name, what);
    command->add_option("INSTANCE", to.which.name, "its path: ise ps")->required();
    add_host(*command, to.which.host);
    if (name == "stop")
        command->add_option("--grace", to.grace, "between SIGTERM and SIGKILL (default: its own)")->type_name("TIME");
    command->callback([&to, &made, act] {
        if (!to.grace.empty()) to.which.grace = positive_time(to.grace, "--grace");
        to.patience = to.which.grace.value_or(10s) + 10s + besides;
        made.talk.body = [options = to.which, act](context& in) { return act(in, options); };
    });
}

} // namespace

void add_instance_commands(CLI::App& app, instance_places& to, wish& made) {
    add_start(app, to, made);
    add_for_one(app, to, made, "stop", "stops a component, with all that it started itself", stop);
    add_for_one(app, to, made, "restart", "stops and starts a component with the same arguments", restart);
    add_for_one(app, to, made, "kill", "ends a component at once; it is not started again", kill);

    auto* logs_command = app.add_subcommand("logs", "shows the output of a component");
    logs_command->add_option("INSTANCE", to.logs.name, "its path: ise ps")->required();
    add_host(*logs_command, to.logs.host);
    logs_command->add_flag("--follow,-f", to.logs.follow, "continue with new output");
    auto* lines = logs_command->add_option("--lines,-n", to.lines, "only the last N lines")->type_name("N");
    logs_command->callback([&to, &made, lines] {
        if (lines->count() > 0) to.logs.lines = to.lines;
        made.talk.endless = to.logs.follow;
        made.talk.body = [options = to.logs](context& in) { return logs(in, options); };
    });

    auto* ps_command = app.add_subcommand("ps", "lists started components with their state");
    ps_command->add_option("PREFIX", to.ps.prefix, "only this path and what is below it");
    add_host(*ps_command, to.ps.host);
    ps_command->add_flag("--names", to.ps.names, "only the paths");
    ps_command->callback([&to, &made] { made.talk.body = [options = to.ps](context& in) { return ps(in, options); }; });
}

} // namespace ise::cli
