// ise up, ise down, ise diff: bring the system to what a deployment file describes.
#include "json.hpp"
#include "options.hpp"
#include "plan_executor.hpp"
#include "text.hpp"

#include <fmt/format.h>

#include <memory>
#include <optional>

namespace ise::cli {
namespace {

struct deployment_summary {
    std::string deployment;
    std::string_view state;
    std::uint64_t components = 0, steps = 0;
};
struct deployment_difference {
    std::string deployment;
    std::vector<planned_step> steps;
    std::vector<std::string> kept;
};

constexpr duration whole_deployment = std::chrono::hours(1); // each step has a limit of its own

struct prepared {
    deployment::deployment wanted;
    fleet there;
    deployment::step_plan plan;
};

task<prepared> prepare(context& in, deployment_options options, bool settled) {
    prepared made;
    made.wanted = read_file(in, options);
    made.there = co_await ask_hosts(in, made.wanted, settled);
    std::vector<deployment::problem> wrong;
    deployment::complete(made.wanted, made.there.hosts, wrong);
    refuse(options.file, wrong);
    co_await check_starts(in, made.wanted, made.there);
    made.plan = deployment::plan_up(made.wanted, made.there.hosts, options.only);
    refuse(options.file, made.plan.problems);
    co_return made;
}

std::string show_deployment(const deployment::deployment& of, const char* word, std::size_t components,
                            std::size_t steps, bool as_json) {
    deployment_summary result{of.name.text, word, components, steps};
    if (as_json) return json_line(result);
    auto done = steps == 0 ? std::string("nothing to do") : fmt::format("{} step{}", steps, steps == 1 ? "" : "s");
    return fmt::format("{} is {}: {} component{}, {}\n", of.name.text, word, components, components == 1 ? "" : "s",
                       done);
}

// One that a component of the file is to run on: what it runs cannot be ended.
std::string server_that_is_missing(const deployment::deployment& of, const fleet& there) {
    for (const auto& one : of.components) {
        const auto* host = of.host(one.host.text);
        if (host && !there.servers.contains(host->server)) return host->server;
    }
    return {};
}

task<> up(context& in, deployment_options options) {
    auto made = co_await prepare(in, options, true);
    auto steps = made.plan.steps.size();
    plan_executor executor(in, made.there);
    plan_executor::manner how;
    how.undo = !options.keep;
    co_await executor.execute(std::move(made.plan.steps), how);
    auto components = options.only.empty() ? made.wanted.components.size() : made.plan.kept.size() + steps;
    auto text = show_deployment(made.wanted, "up", components, steps, in.set.json);
    co_await in.out.write(in.self, std::move(text));
}

task<> down(context& in, deployment_options options) {
    auto wanted = read_file(in, options);
    auto there = co_await ask_hosts(in, wanted, false); // what is just starting is not waited for: it ends anyway
    auto plan = deployment::plan_down(wanted, there.hosts, options.only);
    refuse(options.file, plan.problems);
    auto steps = plan.steps.size();
    plan_executor executor(in, there);
    std::optional<problem> why;
    plan_executor::manner how; // what is to end ends even where something else does not
    how.undo = false;
    how.all = true;
    how.forget = true;
    try {
        co_await executor.execute(std::move(plan.steps), how);
    } catch (const problem& thrown) {
        why = thrown;
    }
    if (auto lacking = server_that_is_missing(wanted, there); !why && options.only.empty() && !lacking.empty())
        why.emplace(exit_code::not_reached, "no_such_name",
                    fmt::format("no instantiation server '{}' is registered, and its components may still be running: "
                                "start it again with the same --state",
                                lacking));
    if (why)
        throw problem(why->code(), why->name(), fmt::format("not all of {} is down: {}", wanted.name.text, why->what()),
                      "ise ps lists the instances; try again");
    auto text = show_deployment(wanted, "down", steps, steps, in.set.json);
    co_await in.out.write(in.self, std::move(text));
}

task<> diff(context& in, deployment_options options) {
    auto made = co_await prepare(in, options, false);
    std::string text;
    if (in.set.json) {
        deployment_difference result{made.wanted.name.text, {}, made.plan.kept};
        for (const auto& one : made.plan.steps) result.steps.push_back(planned_step_of(one));
        text = json_line(result);
    } else {
        for (const auto& one : made.plan.steps) text += printable(deployment::as_text(one, true), true) + "\n";
        if (text.empty())
            text = fmt::format("{} is as {} describes it: {} component{}\n", made.wanted.name.text, options.file,
                               made.wanted.components.size(), made.wanted.components.size() == 1 ? "" : "s");
    }
    co_await in.out.write(in.self, std::move(text));
}

void declare_up(command_line::app& app, parsed_command& made) {
    auto given = std::make_shared<deployment_options>();
    add_file(app, *given);
    app.add_flag("--keep", given->keep, "after a failure or an interruption, do not undo the steps");
    app.add_option("INSTANCE", given->only, "only these components of the file, and their dependencies");
    app.callback([&made, given] {
        made.patience = whole_deployment;
        made.work = [given](context& in) { return up(in, *given); };
    });
}

void declare_down(command_line::app& app, parsed_command& made) {
    auto given = std::make_shared<deployment_options>();
    add_file(app, *given);
    app.add_option("INSTANCE", given->only, "only these components of the file");
    app.callback([&made, given] {
        made.patience = whole_deployment;
        made.work = [given](context& in) { return down(in, *given); };
    });
}

void declare_diff(command_line::app& app, parsed_command& made) {
    auto given = std::make_shared<deployment_options>();
    add_file(app, *given);
    app.add_option("INSTANCE", given->only, "only these components of the file, and their dependencies");
    app.callback([&made, given] { made.work = [given](context& in) { return diff(in, *given); }; });
}

} // namespace

extern const command up_command{"up", deploy_group, "brings the system to what a deployment file describes",
                                "  ise up atirma.toml\n  ise up atirma.toml --set boat=nina\n"
                                "  ise up atirma.toml wind                  only this, and what it comes after\n",
                                declare_up};

extern const command down_command{"down", deploy_group, "stops all of a deployment, in the opposite order",
                                  "  ise down atirma.toml\n", declare_down};

extern const command diff_command{"diff", deploy_group, "what `ise up` would do", "  ise diff atirma.toml\n",
                                  declare_diff};

} // namespace ise::cli
