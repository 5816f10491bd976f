#include "help.hpp"

#include "text.hpp"

#include <apps/wrapped_help.hpp>

#include <CLI/CLI.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <sstream>
#include <string_view>
#include <vector>

namespace ise::cli {
namespace {

struct command_help {
    std::string_view name, group, examples;
};

constexpr std::string_view see_group = "See what there is", talk_group = "Talk to a component",
                           measure_group = "Measure and find faults", run_group = "Start and stop components",
                           deploy_group = "Whole systems, from a deployment file",
                           shell_group = "Of the command itself";

constexpr command_help commands[] = {
    {"list", see_group, "  ise list\n  ise list atirma/shore\n"},
    {"tree", see_group, "  ise tree --services\n"},
    {"describe", see_group,
     "  ise describe atirma/boat\n  ise describe tcp://127.0.0.1:7411        without a name server\n"},
    {"services", see_group, "  ise services\n"},
    {"types", see_group, "  ise types atirma\n"},
    {"type", see_group, "  ise type show atirma/boat helm\n  ise type diff atirma/boat helm atirma/new_boat\n"},
    {"graph", see_group, "  ise graph\n  ise graph --dot | dot -Tsvg > graph.svg\n"},
    {"call", talk_group,
     "  ise call atirma/boat helm '{\"mode\":\"hold\"}'\n  ise call atirma/boat helm {}             every field has "
     "its default\n"
     "  ise call atirma/boat plan - < route.json\n"},
    {"echo", talk_group,
     "  ise echo atirma/boat position\n  ise echo atirma/boat position -n 1       the last value, then end\n"
     "  ise echo atirma/boat position --every 1s --json\n"},
    {"param", talk_group,
     "  ise param list atirma/wind\n  ise param get atirma/wind speed\n  ise param set atirma/wind speed 8\n"},
    {"doctor", measure_group,
     "  ise doctor\n  ise doctor && echo healthy               exit code 1: something is wrong\n"},
    {"top", measure_group, "  ise top\n  ise top atirma --once\n"},
    {"ping", measure_group, "  ise ping atirma/boat -n 10\n"},
    {"hz", measure_group, "  ise hz atirma/boat position\n"},
    {"bw", measure_group, "  ise bw atirma/boat position --window 5s\n"},
    {"delay", measure_group, "  ise delay atirma/boat position --field measured_at\n"},
    {"bench", measure_group,
     "  ise bench atirma/boat --for 3s\n  ise bench atirma/boat helm {} -c 8       really calls helm each time\n"},
    {"start", run_group,
     "  ise start --types                        what can be started\n  ise start --types wind                   its "
     "parameters\n"
     "  ise start wind sea/wind --set speed=8\n"},
    {"ps", run_group, "  ise ps\n"},
    {"stop", run_group, "  ise stop sea/wind\n"},
    {"restart", run_group, "  ise restart sea/wind\n"},
    {"kill", run_group, "  ise kill sea/wind\n"},
    {"logs", run_group, "  ise logs sea/wind -n 20\n  ise logs sea/wind --follow\n"},
    {"validate", deploy_group, "  ise validate atirma.toml\n  ise validate atirma.toml --offline\n"},
    {"diff", deploy_group, "  ise diff atirma.toml\n"},
    {"up", deploy_group,
     "  ise up atirma.toml\n  ise up atirma.toml --set boat=nina\n  ise up atirma.toml wind                  only "
     "this, and what it comes after\n"},
    {"down", deploy_group, "  ise down atirma.toml\n"},
    {"completion", shell_group, "  eval \"$(ise completion bash)\"\n  ise completion fish | source\n"},
    {"version", shell_group, "  ise version\n"},
};

/// Says no more of an option than its value, and no more of a place than its name.
class help_format final : public wrapped_help {
public:
    help_format() {
        column_width(28);
        label("Positionals", "Arguments");
        label("SUBCOMMAND", "COMMAND");
    }
    std::string make_option_opts(const CLI::Option* of) const override {
        if (of->get_positional() || of->get_type_size() == 0) return {};
        auto type = of->get_type_name();
        if (auto choices = type.find('{'); choices != type.npos) {
            type.erase(0, choices);
            std::ranges::replace(type, ',', '|');
        }
        return " " + type.substr(0, type.find(':')); // behind it is what checks it
    }
    std::string make_subcommand(const CLI::App* one) const override {
        std::ostringstream line;
        CLI::detail::format_help(line, one->get_name(), one->get_description(), 14);
        return line.str();
    }
    // The commands before the options.
    std::string make_help(const CLI::App* app, std::string name, CLI::AppFormatMode mode) const override {
        return ise::wrapped(fmt::format("{}{}{}{}{}\n{}", make_description(app), make_usage(app, std::move(name)),
                                        make_subcommands(app, mode), make_positionals(app), make_groups(app, mode),
                                        make_footer(app)));
    }
};

} // namespace

void complete_help(CLI::App& app) {
    auto format = std::make_shared<help_format>();
    app.formatter(format);
    std::string of_every = "Options of every command:\n";
    for (const auto* one : app.get_options())
        if (one != app.get_help_ptr() && one->check_lname("version") == false)
            of_every += format->make_option(one, false);
    for (const auto& one : commands) {
        auto* command = app.get_subcommand(std::string(one.name));
        command->formatter(format);
        command->group(std::string(one.group));
        command->footer(fmt::format("Examples:\n{}\n{}\nExit codes: ise --help", one.examples, of_every));
    }
}

problem unfit(const CLI::App& app, const CLI::ParseError& wrong) {
    auto chosen = app.get_subcommands();
    if (chosen.empty() && dynamic_cast<const CLI::RequiredError*>(&wrong))
        return problem(exit_code::usage, "usage", "a command is missing",
                       "ise --help lists them; ise list shows the components that there are");
    const auto& command = chosen.empty() ? app : *chosen.back();
    auto name = chosen.empty() ? std::string("ise") : "ise " + command.get_name();
    auto usage = help_format().make_usage(&command, name);
    auto advice = fmt::format("usage:{}\n{} --help says more",
                              usage.substr(usage.find(' '), usage.find('\n') - usage.find(' ')), name);
    auto rest = app.remaining(true);
    if (!dynamic_cast<const CLI::ExtrasError*>(&wrong) || rest.empty())
        return problem(exit_code::usage, "usage", wrong.what(), advice);
    auto word = rest.front();
    if (!word.starts_with('-'))
        return problem(exit_code::usage, "usage", fmt::format("'{}' is one argument too many", word), advice);
    std::vector<std::string> known;
    for (const auto* of : {&app, &command})
        for (const auto* one : of->get_options())
            for (const auto& long_name : one->get_lnames()) known.push_back("--" + long_name);
    auto near = nearest(word, known);
    return problem(exit_code::usage, "usage",
                   fmt::format("'{}' has no option '{}'{}", name, word,
                               near.empty() ? "" : fmt::format(", did you mean '{}'?", near.front())),
                   advice);
}

} // namespace ise::cli
