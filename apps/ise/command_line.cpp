#include "command_line.hpp"

#include "arguments.hpp"
#include "commands.hpp"
#include "completion.hpp"
#include "deployment_commands.hpp"
#include "help.hpp"
#include "instance_commands.hpp"
#include "look_commands.hpp"

#include <CLI/CLI.hpp>

#include <algorithm>

namespace ise::cli {
namespace {

constexpr const char* exit_codes = R"(Exit codes:
  0    the answer is complete; also when Ctrl-C ended echo, hz, bw, delay or top, or a reader such as head ended
  1    the component was reached and refused, or failed; a start or a step of up failed; doctor found something
  2    the command line or a deployment file is invalid; a call without its request
  3    not reached: no name server, no such name or service, no answer in time
  4    JSON or packets do not match; the message has the path
  5    the answer could not be written to standard output
  130  Ctrl-C before the answer
Answers go to standard output, everything else to standard error.)";

// CLI11's own places for what is read; they outlive the parse.
struct places {
    wish made;
    std::string timeout = "5s";
    std::string json;
    list_options list;
    describe_options describe;
    call_options call;
    echo_options echo;
    hz_options hz;
    instance_places instances;
    deployment_places deployments;
    look_places look;
    std::string every, length, window;
    std::uint64_t echo_count = 0, hz_count = 0;
    std::string shell;
};

command_info describe_command(const CLI::App& app) {
    command_info made;
    made.name = app.get_name();
    made.description = app.get_description();
    for (const auto* one : app.get_options()) {
        option_info info;
        info.description = one->get_description();
        info.takes_value = one->get_items_expected_max() > 0;
        auto type = one->get_type_name(); // "TEXT:{bash,fish,zsh}"
        if (auto from = type.find('{'), to = type.find('}'); from != std::string::npos && to > from)
            info.choices = CLI::detail::split(type.substr(from + 1, to - from - 1), ',');
        if (one->get_positional()) {
            info.names.push_back(one->get_name());
            made.places.push_back(std::move(info));
        } else {
            for (const auto& name : one->get_lnames()) info.names.push_back("--" + name);
            for (const auto& name : one->get_snames()) info.names.push_back("-" + name);
            made.options.push_back(std::move(info));
        }
    }
    for (const auto* below : app.get_subcommands([](const CLI::App*) { return true; }))
        made.commands.push_back(describe_command(*below));
    return made;
}

void build(CLI::App& app, places& to) {
    auto& set = to.made.set;
    app.require_subcommand(1);
    app.fallthrough();
    app.set_version_flag("--version", "ise " ISE_VERSION);
    app.footer(exit_codes);
    app.add_option("--name-server", set.name_server,
                   "its endpoint (default: $ISE_NAME_SERVER, else tcp://127.0.0.1:7400)")
        ->type_name("ENDPOINT");
    app.add_option("--key", set.security.key_file, "a file with the shared key of the system (default: $ISE_KEY)")
        ->type_name("FILE");
    app.add_option("--tls", set.security.tls_folder,
                   "a folder with ca.pem, certificate.pem and key.pem, for tls:// endpoints (default: $ISE_TLS)")
        ->type_name("FOLDER");
    app.add_option("--as", set.as,
                   "the path under which this command appears to components, such as an operator's; not checked")
        ->type_name("PATH");
    app.add_option("--timeout", to.timeout, "for the whole command, or its first answer (default: 5s)")
        ->type_name("TIME");
    app.add_flag("--wait", set.wait, "wait for a component that is not there yet, until the timeout");
    app.add_flag("--json", set.json, "answers, errors and notes as one line of JSON each");
    app.add_flag("--pretty", set.pretty, "JSON over several lines");
    app.add_flag("--verbose", set.verbose, "log to standard error");

    auto* list_command = app.add_subcommand("list", "lists the components that the name server knows");
    list_command->add_option("PREFIX", to.list.prefix, "only this path and what is below it");
    list_command->add_flag("--names", to.list.names, "only the paths");
    list_command->callback(
        [&to] { to.made.talk.body = [options = to.list](context& in) { return list(in, options); }; });

    auto* describe_command =
        app.add_subcommand("describe", "shows endpoints, services, packets and sessions of a component");
    describe_command
        ->add_option("NAME", to.describe.name, "path of a component, or endpoint such as tcp://127.0.0.1:7411")
        ->required();
    describe_command->add_flag("--all", to.describe.all, "ISE's own services too");
    describe_command->add_flag("--names", to.describe.names, "only the names of its services");
    describe_command->callback(
        [&to] { to.made.talk.body = [options = to.describe](context& in) { return describe(in, options); }; });

    auto* call_command = app.add_subcommand("call", "calls a service and prints the response as JSON");
    call_command->add_option("NAME", to.call.name, "path of a component, or endpoint such as tcp://127.0.0.1:7411")
        ->required();
    call_command->add_option("SERVICE", to.call.service, "name of a request-response service")->required();
    call_command->add_option("JSON", to.json,
                             "request; - reads standard input; {} uses the defaults (required if it has fields)");
    call_command->callback([&to] {
        if (!to.json.empty()) to.call.json = json_given(to.json);
        to.made.talk.body = [options = to.call](context& in) { return call(in, options); };
    });

    auto* echo_command = app.add_subcommand("echo", "subscribes and prints each packet as a line of JSON");
    add_subscription(*echo_command, to.echo.what, to.json);
    auto* count = echo_command->add_option("--count,-n", to.echo_count, "end after N packets")
                      ->type_name("N")
                      ->check(positive_count());
    echo_command
        ->add_option("--for", to.length, "end after this time; with --count: exit code 3 if fewer packets arrived")
        ->type_name("TIME");
    echo_command->add_option("--every", to.every, "at most one packet in this time; others are skipped")
        ->type_name("TIME");
    echo_command->add_flag("--no-last", to.echo.no_last_value, "without the packet that was published last before");
    echo_command->add_flag("--losses", to.echo.losses,
                           R"(each line is {"lost_before":N,"packet":{...}}; null: unknown)");
    echo_command->callback([&to, count] {
        to.echo.what.json = json_given(to.json);
        if (count->count() > 0) to.echo.count = to.echo_count;
        if (!to.length.empty()) to.echo.length = positive_time(to.length, "--for");
        if (!to.every.empty()) to.echo.every = positive_time(to.every, "--every");
        to.made.talk.endless = !to.echo.count;
        to.made.talk.body = [options = to.echo](context& in) { return echo(in, options); };
    });

    auto* hz_command = app.add_subcommand("hz", "rate, jitter and losses of a subscription's packets");
    add_subscription(*hz_command, to.hz.what, to.json);
    hz_command->add_option("--window", to.window, "time of one line (default: 1s)")->type_name("TIME");
    auto* lines =
        hz_command->add_option("--count,-n", to.hz_count, "end after N lines")->type_name("N")->check(positive_count());
    hz_command->callback([&to, lines] {
        to.hz.what.json = json_given(to.json);
        if (lines->count() > 0) to.hz.count = to.hz_count;
        if (!to.window.empty()) to.hz.window = positive_time(to.window, "--window");
        to.made.talk.endless = !to.hz.count;
        to.made.talk.body = [options = to.hz](context& in) { return hz(in, options); };
    });

    add_instance_commands(app, to.instances, to.made);
    add_deployment_commands(app, to.deployments, to.made);
    add_look_commands(app, to.look, to.made);

    auto* completion_command = app.add_subcommand("completion", "prints a completion script for a shell");
    completion_command->add_option("SHELL", to.shell, "bash, zsh or fish")
        ->required()
        ->check(one_of({"bash", "zsh", "fish"}));
    completion_command->callback(
        [&to, &app] { to.made.text = completion_script(cli::describe_command(app), to.shell); });

    auto* version_command = app.add_subcommand("version", "prints the version");
    version_command->callback([&to] { to.made.text = "ise " ISE_VERSION "\n"; });
}

} // namespace

wish read_command_line(int count, const char* const* arguments) {
    places to;
    CLI::App app("Lists, describes, calls, listens to, looks after and starts components.", "ise");
    build(app, to);
    complete_help(app);
    refuse_unknown_command(app, count, arguments);
    try {
        app.parse(count, arguments);
    } catch (const CLI::CallForHelp&) {
        to.made.talk = {};
        to.made.text = app.help();
        return to.made;
    } catch (const CLI::CallForVersion& version) {
        to.made.talk = {};
        to.made.text = std::string(version.what()) + "\n";
        return to.made;
    } catch (const CLI::ParseError& wrong) {
        throw unfit(app, wrong);
    }
    to.made.set.timeout = positive_time(to.timeout, "--timeout");
    auto patience = std::max(to.instances.patience, to.deployments.patience);
    if (patience > duration{} && app.get_option("--timeout")->count() == 0) to.made.set.timeout = patience;
    return to.made;
}

} // namespace ise::cli
