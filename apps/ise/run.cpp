// ise run: runs an action, and prints its progress and its result as lines of JSON.
#include "options.hpp"
#include "target.hpp"
#include "text.hpp"

#include <ise/service/action.hpp>
#include <ise/service/dynamic.hpp>

#include <fmt/format.h>

#include <memory>
#include <string>
#include <utility>

namespace ise::cli {
namespace {

struct run_command_options {
    std::string name, action;
    std::string json; ///< the goal; empty: none was given
    duration deadline{}, idle{};
};

task<> run_action(context& in, run_command_options options) {
    auto who = co_await reach(in, options.name);
    auto service = co_await find_service(in, who, options.action, service_kind::subscription);
    if (!is_action(*service.types()))
        throw problem(exit_code::usage, "usage",
                      fmt::format("'{}' at {} is a subscription, not an action", options.action, options.name),
                      fmt::format("subscribe to it: ise echo {} {}", options.name, options.action));
    auto types = schemas_of_action(*service.types());
    if (options.json.empty() && !types.goal.type().members.empty())
        throw problem(exit_code::usage, "usage",
                      fmt::format("the goal of '{}' has fields, and none was given", options.action),
                      fmt::format("it is {}\ngive what matters, or {{}} for the defaults:\n{}", types.goal.pretty(),
                                  example(options.name, service)));
    if (options.json.empty()) options.json = "{}";
    auto goal = co_await packet_from(in, types.goal, options.json, "goal");
    run_options limits;
    limits.accept = in.left();
    limits.deadline = options.deadline;
    limits.idle = options.idle;
    auto started = co_await start_dynamic(who, service, std::move(goal), limits);
    if (!started) throw problem(started.error()).of_call(started.error().executed());
    auto& run = *started;
    if (run.queue_position() > 0)
        note(in.set, fmt::format("accepted; {} other goal{} ahead", run.queue_position(),
                                 run.queue_position() == 1 ? " is" : "s are"));
    const auto style = in.set.pretty ? json_style::pretty : json_style::compact;
    for (;;) {
        auto report = co_await run.next();
        if (!report) break;
        auto line = fmt::format("{{\"feedback\":{}}}\n", report->to_json(style));
        co_await in.out.write(in.self, std::move(line));
    }
    auto outcome = co_await run.outcome();
    if (!outcome) throw problem(outcome.error()).of_call(outcome.error().executed());
    auto line = fmt::format("{{\"result\":{}}}\n", outcome->to_json(style));
    co_await in.out.write(in.self, std::move(line));
}

void declare_run(command_line::app& app, parsed_command& made) {
    auto given = std::make_shared<run_command_options>();
    add_component(app, given->name);
    app.add_option("SERVICE", given->action, "name of an action")->required();
    app.add_option("JSON", given->json,
                   "goal; - reads standard input; {} uses the defaults (required if it has fields)");
    add_time(app, "--deadline", given->deadline, "cancel the run after this time");
    add_time(app, "--idle", given->idle, "cancel it if it reports nothing for this time");
    app.callback([&made, given] {
        if (!given->json.empty()) given->json = json_given(given->json);
        made.work = [given](context& in) { return run_action(in, *given); };
    });
}

} // namespace

extern const command run_command{"run", talk_group, "runs an action; prints its progress and its result",
                                 "  ise run atirma/boat sail_to '{\"name\":\"bay\"}'       Ctrl-C cancels it\n"
                                 "  ise run atirma/boat sail_to {} --deadline 10m --idle 30s\n",
                                 declare_run};

} // namespace ise::cli
