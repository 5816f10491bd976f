#include "commands.hpp"

#include "carrier.hpp"
#include "text.hpp"

#include <nlohmann/json.hpp>

#include <fmt/format.h>

#include <optional>

namespace ise::cli {
namespace {

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

std::string summary(const deployment::deployment& of, const char* word, std::size_t components, std::size_t steps,
                    bool json) {
    if (json) {
        nlohmann::ordered_json told;
        told["deployment"] = of.name.text;
        told["state"] = word;
        told["components"] = components;
        told["steps"] = steps;
        return told.dump() + "\n";
    }
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

} // namespace

task<> up(context& in, deployment_options options) {
    auto made = co_await prepare(in, options, true);
    auto steps = made.plan.steps.size();
    carrier hands(in, made.there);
    carrier::manner how;
    how.undo = !options.keep;
    co_await hands.carry_out(std::move(made.plan.steps), how);
    auto components = options.only.empty() ? made.wanted.components.size() : made.plan.kept.size() + steps;
    auto text = summary(made.wanted, "up", components, steps, in.set.json);
    co_await in.out.write(in.self, std::move(text));
}

task<> down(context& in, deployment_options options) {
    auto wanted = read_file(in, options);
    auto there = co_await ask_hosts(in, wanted, false); // what is just starting is not waited for: it ends anyway
    auto plan = deployment::plan_down(wanted, there.hosts, options.only);
    refuse(options.file, plan.problems);
    auto steps = plan.steps.size();
    carrier hands(in, there);
    std::optional<problem> why;
    carrier::manner how; // what is to end ends even where something else does not
    how.undo = false;
    how.all = true;
    how.forget = true;
    try {
        co_await hands.carry_out(std::move(plan.steps), how);
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
                      "ise ps tells what runs; try again");
    auto text = summary(wanted, "down", steps, steps, in.set.json);
    co_await in.out.write(in.self, std::move(text));
}

task<> diff(context& in, deployment_options options) {
    auto made = co_await prepare(in, options, false);
    std::string text;
    if (in.set.json) {
        nlohmann::ordered_json told;
        told["deployment"] = made.wanted.name.text;
        auto steps = nlohmann::ordered_json::array();
        for (const auto& one : made.plan.steps) steps.push_back(nlohmann::ordered_json::parse(as_json(one)));
        told["steps"] = std::move(steps);
        told["kept"] = made.plan.kept;
        text = told.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
    } else {
        for (const auto& one : made.plan.steps) text += printable(deployment::as_text(one, true), true) + "\n";
        if (text.empty())
            text = fmt::format("{} is as {} describes it: {} component{}\n", made.wanted.name.text, options.file,
                               made.wanted.components.size(), made.wanted.components.size() == 1 ? "" : "s");
    }
    co_await in.out.write(in.self, std::move(text));
}

} // namespace ise::cli
