// ise validate: whether a deployment file can be used.
#include "deployments.hpp"
#include "json.hpp"
#include "options.hpp"

#include <ise/deployment/ordering.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <tuple>

namespace ise::cli {
namespace {

struct validated {
    std::string deployment;
    std::uint64_t components = 0, hosts = 0;
    bool types_checked = false;
    std::vector<std::string> order;
};

struct asked_hosts {
    bool answered = false;
    std::string why; ///< not
    fleet there;
};

// Whether somebody is there to ask is nothing that the file is to blame for.
task<asked_hosts> ask_if_there(context& in, const deployment::deployment& of) {
    asked_hosts made;
    try {
        made.there = co_await ask_hosts(in, of, false);
        made.answered = true;
    } catch (const problem& thrown) {
        made.why = thrown.what();
    }
    co_return made;
}

const char* many(std::size_t count) { return count == 1 ? "" : "s"; }

task<> validate(context& in, deployment_options options) {
    auto read = read_what_there_is(in, options);
    auto& wanted = read.made;
    auto& wrong = read.problems;
    if (wanted.components.empty()) refuse(options.file, wrong); // there is nothing to ask about
    bool readable = wrong.empty();
    bool checked = false;
    std::vector<const type_info*> types(wanted.components.size(), nullptr);
    asked_hosts there;
    if (!options.offline) {
        there = co_await ask_if_there(in, wanted);
        checked = there.answered;
        if (!checked) note(in.set, fmt::format("types and parameters were not checked: {}", there.why));
    }
    if (checked) {
        deployment::complete(wanted, there.there.hosts, wrong);
        for (std::size_t at = 0; at < types.size(); ++at)
            if (const auto* state = deployment::state_of(wanted, wanted.components[at].host.text, there.there.hosts))
                types[at] = state->type(wanted.components[at].type.text);
    }
    deployment::ordering sorted;
    if (readable) sorted = deployment::order_of(wanted, types);
    wrong.insert(wrong.end(), sorted.problems.begin(), sorted.problems.end());
    if (checked && wrong.empty()) {
        co_await check_starts(in, wanted, there.there);
        wrong = deployment::plan_up(wanted, there.there.hosts).problems;
    }
    std::ranges::stable_sort(
        wrong, {}, [](const deployment::problem& one) { return std::tuple(one.at.file, one.at.line, one.at.column); });
    refuse(options.file, wrong);
    std::string text;
    if (in.set.json) {
        validated result{wanted.name.text, wanted.components.size(), wanted.hosts.size(), checked, {}};
        for (auto which : sorted.order) result.order.push_back(wanted.components[which].request.path);
        text = json_line(result);
    } else {
        text = fmt::format("{} is valid: {} with {} component{} on {} host{}{}\n", options.file, wanted.name.text,
                           wanted.components.size(), many(wanted.components.size()), wanted.hosts.size(),
                           many(wanted.hosts.size()),
                           checked ? "; all types and parameters exist, and nothing stands in the way" : "");
    }
    co_await in.out.write(in.self, std::move(text));
}

void declare_validate(command_line::app& app, parsed_command& made) {
    auto given = std::make_shared<deployment_options>();
    add_file(app, *given);
    app.add_flag("--offline", given->offline, "do not query hosts for types and parameters");
    app.callback([&made, given] { made.work = [given](context& in) { return validate(in, *given); }; });
}

} // namespace

extern const command validate_command{"validate", deploy_group, "whether a deployment file can be used",
                                      "  ise validate atirma.toml\n  ise validate atirma.toml --offline\n",
                                      declare_validate};

} // namespace ise::cli
