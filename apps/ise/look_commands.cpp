#include "look_commands.hpp"

#include "arguments.hpp"
#include "names.hpp"
#include "text.hpp"

#include <CLI/CLI.hpp>

#include <fmt/format.h>

#include <algorithm>

namespace ise::cli {
namespace {

constexpr const char* component_name = "path of a component, or endpoint such as tcp://127.0.0.1:7411";

void add_prefix(CLI::App& command, std::string& prefix) {
    command.add_option("PREFIX", prefix, "only this path and what is below it");
}

void add_doctor(CLI::App& app, look_places& to, wish& made) {
    auto* command = app.add_subcommand("doctor", "finds problems and remedies; exit code 1 if there are any");
    command->add_option("--interval", to.interval, "time between its two inspections (default: 1s)")->type_name("TIME");
    command->callback([&to, &made] {
        if (!to.interval.empty()) to.doctor.interval = positive_time(to.interval, "--interval");
        made.talk.looks = true;
        made.talk.body = [options = to.doctor](context& in) { return doctor(in, options); };
    });
}

void add_graph(CLI::App& app, look_places& to, wish& made) {
    auto* command = app.add_subcommand("graph", "shows the connections between components");
    add_prefix(*command, to.graph.prefix);
    command->add_flag("--dot", to.graph.dot, "for Graphviz: ise graph --dot | dot -Tsvg");
    command->callback([&to, &made] {
        check_prefix(to.graph.prefix);
        made.talk.looks = true;
        made.talk.body = [options = to.graph](context& in) { return graph(in, options); };
    });
}

void add_top(CLI::App& app, look_places& to, wish& made) {
    auto* command = app.add_subcommand("top", "shows the activity of every component; q or Ctrl-C ends");
    add_prefix(*command, to.top.prefix);
    command->add_option("--every", to.every, "time between two tables (default: 1s)")->type_name("TIME");
    auto* once = command->add_flag("--once", to.once, "one table, after that time");
    auto* lines = command->add_option("--count,-n", to.lines, "end after N tables")
                      ->type_name("N")
                      ->check(positive_count())
                      ->excludes(once);
    command->callback([&to, &made, lines] {
        check_prefix(to.top.prefix);
        if (!to.every.empty()) to.top.every = positive_time(to.every, "--every");
        if (lines->count() > 0) to.top.count = to.lines;
        if (to.once) to.top.count = 1;
        made.talk.looks = true;
        made.talk.endless = !to.top.count;
        made.talk.body = [options = to.top](context& in) { return top(in, options); };
    });
}

void add_ping(CLI::App& app, look_places& to, wish& made) {
    auto* command = app.add_subcommand("ping", "measures round trips to a component and its clock offset");
    command->add_option("NAME", to.ping.name, component_name)->required();
    command->add_option("--count,-n", to.ping.count, "number of requests (default: 5)")
        ->type_name("N")
        ->check(CLI::Range(1u, 1'000'000u));
    command->add_option("--every", to.ping_every, "time between them (default: 200ms)")->type_name("TIME");
    command->callback([&to, &made] {
        if (!to.ping_every.empty()) to.ping.every = positive_time(to.ping_every, "--every");
        made.talk.looks = true;
        made.talk.body = [options = to.ping](context& in) { return ping(in, options); };
    });
}

void add_bench(CLI::App& app, look_places& to, wish& made) {
    auto* command = app.add_subcommand("bench", "measures calls per second of a service, and their latency");
    command->add_option("NAME", to.bench.name, component_name)->required();
    command->add_option("SERVICE", to.bench.service,
                        "a request-response service; every call has its effects (default: ise.health)");
    command->add_option("JSON", to.json, "the request; - reads it from standard input");
    command->add_option("--concurrent,-c", to.bench.concurrent, "calls at once (default: 1)")
        ->type_name("N")
        ->check(CLI::Range(1u, 1024u));
    command->add_option("--for", to.length, "how long (default: 5s)")->type_name("TIME");
    command->callback([&to, &made] {
        if (!to.length.empty()) to.bench.length = positive_time(to.length, "--for");
        if (!to.json.empty()) to.bench.json = json_given(to.json);
        made.talk.looks = true;
        made.talk.body = [options = to.bench](context& in) { return bench(in, options); };
    });
}

CLI::App* add_meter(CLI::App& app, look_places& to, hz_options& into, const std::string& name,
                    const std::string& what) {
    auto* command = app.add_subcommand(name, what);
    add_subscription(*command, into.what, to.json);
    command->add_option("--window", to.window, "time of one line (default: 1s)")->type_name("TIME");
    command->add_option("--count,-n", to.lines, "end after N lines")->type_name("N")->check(positive_count());
    return command;
}

void read_meter(look_places& to, wish& made, hz_options& into) {
    into.what.json = json_given(to.json);
    if (to.lines > 0) into.count = to.lines;
    if (!to.window.empty()) into.window = positive_time(to.window, "--window");
    made.talk.endless = !into.count;
}

void add_meters(CLI::App& app, look_places& to, wish& made) {
    auto* bw_command = add_meter(app, to, to.bw, "bw", "bytes and packets per second of a subscription");
    bw_command->callback([&to, &made] {
        read_meter(to, made, to.bw);
        made.talk.body = [options = to.bw](context& in) { return bw(in, options); };
    });
    auto* delay_command =
        add_meter(app, to, to.delay.from, "delay", "how old a subscription's packets are when they come");
    delay_command
        ->add_option("--field", to.delay.field,
                     "a time in the packets (default: measured_at, else received_at, else the only one)")
        ->type_name("FIELD");
    delay_command->callback([&to, &made] {
        read_meter(to, made, to.delay.from);
        made.talk.body = [options = to.delay](context& in) { return delay(in, options); };
    });
}

void add_tree(CLI::App& app, look_places& to, wish& made) {
    auto* command = app.add_subcommand("tree", "shows the components as a tree");
    add_prefix(*command, to.tree.prefix);
    command->add_flag("--services", to.tree.services, "their services too");
    command->callback([&to, &made] {
        made.talk.looks = to.tree.services;
        made.talk.body = [options = to.tree](context& in) { return tree(in, options); };
    });
}

void add_for_all(CLI::App& app, look_places& to, wish& made, const std::string& name, const std::string& what,
                 task<> (*act)(context&, services_options)) {
    auto* command = app.add_subcommand(name, what);
    add_prefix(*command, to.services.prefix);
    command->add_flag("--all", to.services.all, "ISE's own services too");
    command->callback([&to, &made, act] {
        made.talk.looks = true;
        made.talk.body = [options = to.services, act](context& in) { return act(in, options); };
    });
}

void add_type(CLI::App& app, look_places& to, wish& made) {
    auto* command = app.add_subcommand("type", "shows the packets of a service, or compares those of two");
    command->add_option("ACTION", to.type.act, "show: the packets of a service; diff: compare those of two")
        ->required()
        ->check(one_of({"diff", "show"}));
    command->add_option("NAME", to.type.name, component_name)->required();
    command->add_option("SERVICE", to.type.service, "name of a service that it provides or requires")->required();
    command->add_option("OTHER_NAME", to.type.other_name, "of diff: the component to compare with");
    command->add_option("OTHER_SERVICE", to.type.other_service, "of diff: its service (default: the same)");
    command->callback([&to, &made] {
        bool two = to.type.act == "diff";
        if (two == to.type.other_name.empty())
            throw problem(
                exit_code::usage, "usage",
                two ? "with what is it to be compared?" : "'type show' takes one component and one service",
                two ? fmt::format("ise type diff {} {} OTHER_NAME [OTHER_SERVICE]", to.type.name, to.type.service)
                    : "to compare two: ise type diff");
        made.talk.body = [options = to.type](context& in) { return type(in, options); };
    });
}

} // namespace

void add_look_commands(CLI::App& app, look_places& to, wish& made) {
    add_doctor(app, to, made);
    add_graph(app, to, made);
    add_top(app, to, made);
    add_ping(app, to, made);
    add_bench(app, to, made);
    add_meters(app, to, made);
    add_tree(app, to, made);
    add_for_all(app, to, made, "services", "lists services with their providers and users", services);
    add_for_all(app, to, made, "types", "the packet types, and where they are used", types);
    add_type(app, to, made);
}

void refuse_unknown_command(const CLI::App& app, int count, const char* const* arguments) {
    for (int at = 1; at < count; ++at) {
        std::string word = arguments[at];
        if (word.starts_with('-') && word.size() > 1) {
            const auto* option = app.get_option_no_throw(word);
            if (option && option->get_items_expected_max() > 0) ++at; // its value
            continue;
        }
        std::vector<std::string> known;
        for (const auto* one : app.get_subcommands([](const CLI::App*) { return true; }))
            known.push_back(one->get_name());
        if (std::ranges::find(known, word) != known.end()) return;
        auto near = nearest(word, known);
        if (near.empty())
            throw problem(exit_code::usage, "usage", fmt::format("no command '{}'", printable(word)),
                          "ise --help lists them");
        throw problem(exit_code::usage, "usage",
                      fmt::format("no command '{}', did you mean '{}'?", printable(word), near.front()),
                      "ise --help lists them all");
    }
}

} // namespace ise::cli
