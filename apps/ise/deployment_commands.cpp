#include "deployment_commands.hpp"

#include "arguments.hpp"

#include <CLI/CLI.hpp>

namespace ise::cli {
namespace {

using namespace std::chrono_literals;

// Each step has a limit of its own.
constexpr duration whole_deployment = 1h;

using command = task<> (*)(context&, deployment_options);

CLI::App* add_for_file(CLI::App& app, deployment_places& to, wish& made, const std::string& name,
                       const std::string& what, command act, duration patience) {
    auto* added = app.add_subcommand(name, what);
    added->add_option("FILE", to.file.file, "a deployment file (docs/deployment.md)")->required();
    added->add_option("--set,-s", to.file.set, "a variable of the file; several are allowed")
        ->type_name("NAME=VALUE")
        ->allow_extra_args(false);
    added->callback([&to, &made, act, patience] {
        to.patience = patience;
        made.talk.body = [options = to.file, act](context& in) { return act(in, options); };
    });
    return added;
}

} // namespace

void add_deployment_commands(CLI::App& app, deployment_places& to, wish& made) {
    auto* up_command = add_for_file(app, to, made, "up", "brings the system to what a deployment file describes", up,
                                    whole_deployment);
    up_command->add_flag("--keep", to.file.keep, "after a failure or an interruption, do not undo the steps");
    auto* down_command =
        add_for_file(app, to, made, "down", "stops all of a deployment, in the opposite order", down, whole_deployment);
    auto* diff_command = add_for_file(app, to, made, "diff", "what `ise up` would do", diff, duration{});
    for (auto* one : {up_command, diff_command})
        one->add_option("INSTANCE", to.file.only, "only these components of the file, and their dependencies");
    down_command->add_option("INSTANCE", to.file.only, "only these components of the file");
    auto* validate_command =
        add_for_file(app, to, made, "validate", "whether a deployment file can be used", validate, duration{});
    validate_command->add_flag("--offline", to.file.offline, "do not query hosts for types and parameters");

    auto* param_command = app.add_subcommand("param", "lists, reads or sets parameters of a running component");
    param_command->add_option("ACTION", to.param.act, "list, get or set")
        ->required()
        ->check(one_of({"get", "list", "set"}));
    param_command->add_option("NAME", to.param.name, "path of a component, or endpoint such as tcp://127.0.0.1:7411")
        ->required();
    param_command->add_option("PARAMETER", to.param.parameter, "of get and set: its name");
    auto* value = param_command->add_option("VALUE", to.value, "of set: the new value");
    param_command->add_flag("--names", to.param.names, "of list: only the names");
    param_command->callback([&to, &made, value] {
        if (value->count() > 0) to.param.value = to.value;
        to.patience = 15s;
        made.talk.body = [options = to.param](context& in) { return param(in, options); };
    });
}

} // namespace ise::cli
