// The command line: the table of all commands, what is common to their help, and the parse.
#include "command.hpp"
#include "options.hpp"
#include "text.hpp"

#include <apps/program_options.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <memory>
#include <sstream>
#include <vector>

namespace ise::cli {

namespace {

constexpr const char* exit_codes = R"(Exit codes:
  0    the answer is complete; also when Ctrl-C ended echo, hz, bw, delay, top, pub or mock, or a reader such as head ended
  1    the component was reached and refused, or failed; a start or a step of up failed; doctor found something
  2    the command line or a deployment file is invalid; a call without its request
  3    not reached: no name server, no such name or service, no answer in time
  4    JSON or packets do not match; the message has the path
  5    the answer could not be written to standard output
  130  Ctrl-C before the answer
Answers go to standard output, everything else to standard error.)";

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

// All that is known of `app` before its commands are added is common to them.
void add_commands(CLI::App& app, parsed_command& made) {
    auto format = std::make_shared<help_format>();
    app.formatter(format);
    std::string of_every = "Options of every command:\n";
    for (const auto* one : app.get_options())
        if (one != app.get_help_ptr() && one->check_lname("version") == false)
            of_every += format->make_option(one, false);
    for (const auto* one : all_commands()) {
        auto* added = app.add_subcommand(std::string(one->name), std::string(one->summary));
        added->formatter(format);
        added->group(std::string(one->group));
        added->footer(fmt::format("Examples:\n{}\n{}\nExit codes: ise --help", one->examples, of_every));
        one->declare(*added, made);
    }
}

void add_common_options(CLI::App& app, settings& set) {
    app.require_subcommand(1);
    app.fallthrough();
    app.set_version_flag("--version", "ise " ISE_VERSION);
    app.footer(exit_codes);
    app.add_option("--name-server", set.name_server,
                   "its endpoint (default: $ISE_NAME_SERVER, else tcp://127.0.0.1:7400)")
        ->type_name("ENDPOINT");
    add_credentials(app, set.security);
    app.add_option("--as", set.as,
                   "the path under which this command appears to components, such as an operator's; not checked")
        ->type_name("PATH");
    add_time(app, "--timeout", set.timeout, "for the whole command, or its first answer (default: 5s)");
    app.add_flag("--wait", set.wait,
                 "wait for a component or an instantiation server that is not there yet, until the timeout");
    app.add_flag("--json", set.json, "answers, errors and notes as one line of JSON each");
    app.add_flag("--pretty", set.pretty, "JSON over several lines");
    app.add_flag("--verbose", set.verbose, "log to standard error");
}

// Before the parse, whose own words about an unknown command say less.
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

// What CLI11 refused, with the usage of the command.
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

} // namespace

parsed_command read_command_line(int count, const char* const* arguments) {
    parsed_command made;
    CLI::App app("Lists, describes, calls, listens to, looks after and starts components.", "ise");
    add_common_options(app, made.set);
    add_commands(app, made);
    refuse_unknown_command(app, count, arguments);
    try {
        app.parse(count, arguments);
    } catch (const CLI::CallForHelp&) {
        made.text = app.help();
        return made;
    } catch (const CLI::CallForVersion& version) {
        made.text = std::string(version.what()) + "\n";
        return made;
    } catch (const CLI::ParseError& wrong) {
        throw unfit(app, wrong);
    }
    if (made.patience && app.get_option("--timeout")->count() == 0) made.set.timeout = *made.patience;
    return made;
}

} // namespace ise::cli
