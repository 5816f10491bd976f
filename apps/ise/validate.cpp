#include "commands.hpp"

#include "deployments.hpp"

#include <ise/deployment/ordering.hpp>

#include <nlohmann/json.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <tuple>

namespace ise::cli {
namespace {

struct asked {
    bool answered = false;
    std::string why; ///< not
    fleet there;
};

// Whether somebody is there to ask is nothing that the file is to blame for.
task<asked> ask_if_there(context& in, const deployment::deployment& of) {
    asked made;
    try {
        made.there = co_await ask_hosts(in, of, false);
        made.answered = true;
    } catch (const problem& thrown) {
        made.why = thrown.what();
    }
    co_return made;
}

const char* many(std::size_t count) { return count == 1 ? "" : "s"; }

} // namespace

task<> validate(context& in, deployment_options options) {
    auto read = read_what_there_is(in, options);
    auto& wanted = read.made;
    auto& wrong = read.problems;
    if (wanted.components.empty()) refuse(options.file, wrong); // there is nothing to ask about
    bool readable = wrong.empty();
    bool checked = false;
    std::vector<const type_text*> types(wanted.components.size(), nullptr);
    asked told;
    if (!options.offline) {
        told = co_await ask_if_there(in, wanted);
        checked = told.answered;
        if (!checked) note(in.set, fmt::format("types and parameters were not checked: {}", told.why));
    }
    if (checked) {
        deployment::complete(wanted, told.there.hosts, wrong);
        for (std::size_t at = 0; at < types.size(); ++at)
            if (const auto* state = deployment::state_of(wanted, wanted.components[at].host.text, told.there.hosts))
                types[at] = state->type(wanted.components[at].type.text);
    }
    deployment::ordering sorted;
    if (readable) sorted = deployment::order_of(wanted, types);
    wrong.insert(wrong.end(), sorted.problems.begin(), sorted.problems.end());
    if (checked && wrong.empty()) {
        co_await check_starts(in, wanted, told.there);
        wrong = deployment::plan_up(wanted, told.there.hosts).problems;
    }
    std::ranges::stable_sort(
        wrong, {}, [](const deployment::problem& one) { return std::tuple(one.at.file, one.at.line, one.at.column); });
    refuse(options.file, wrong);
    std::string text;
    if (in.set.json) {
        nlohmann::ordered_json made;
        made["deployment"] = wanted.name.text;
        made["components"] = wanted.components.size();
        made["hosts"] = wanted.hosts.size();
        made["types_checked"] = checked;
        auto order = nlohmann::ordered_json::array();
        for (auto which : sorted.order) order.push_back(wanted.components[which].request.path);
        made["order"] = std::move(order);
        text = made.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
    } else {
        text = fmt::format(
            "{} is well formed: {} with {} component{} on {} host{}{}\n", options.file, wanted.name.text,
            wanted.components.size(), many(wanted.components.size()), wanted.hosts.size(), many(wanted.hosts.size()),
            checked ? ", all of types and with parameters that there are, and no obstacle was found" : "");
    }
    co_await in.out.write(in.self, std::move(text));
}

} // namespace ise::cli
