// The command line: the table of all commands, what is common to their help, and the parse.
#include "command.hpp"
#include "options.hpp"
#include "text.hpp"

#include <apps/program_options.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <vector>

namespace ise::cli {

namespace {

constexpr const char* exit_codes = R"(Exit codes:
  0    the answer is complete; also when Ctrl-C ended a command that runs until Ctrl-C, or a reader such as head ended
  1    the component was reached and refused, or failed; a start or a step of up failed; doctor found something
  2    the command line or a deployment file is invalid; a call without its request
  3    not reached: no name server, no such name or service, no answer in time
  4    JSON or packets do not match; the message has the path
  5    the answer could not be written to standard output
  130  Ctrl-C before the answer
Answers go to standard output, everything else to standard error.)";

// All that is known of `app` before its commands are added is common to them.
void add_commands(command_line::app& app, parsed_command& made) {
    app.brief_help();
    auto of_every = "Options of every command:\n" + app.options_help();
    for (const auto* one : all_commands()) {
        auto* added = app.add_subcommand(std::string(one->name), std::string(one->summary));
        added->group(std::string(one->group));
        added->footer(fmt::format("Examples:\n{}\n{}\nExit codes: ise --help", one->examples, of_every));
        one->declare(*added, made);
    }
}

void add_common_options(command_line::app& app, settings& set) {
    app.require_subcommand(1);
    app.fallthrough();
    app.set_version_flag("--version", "ise " ISE_VERSION);
    app.footer(exit_codes);
    app.add_option("--name-server", set.name_server,
                   "endpoints of the name servers, separated by commas (default: $ISE_NAME_SERVER, else "
                   "tcp://127.0.0.1:7400)")
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
void refuse_unknown_command(const command_line::app& app, int count, const char* const* arguments) {
    const auto program = app.info();
    for (int at = 1; at < count; ++at) {
        std::string word = arguments[at];
        if (word.starts_with('-') && word.size() > 1) {
            for (const auto& option : program.options)
                if (option.takes_value && std::ranges::count(option.names, word) > 0) ++at; // its value
            continue;
        }
        std::vector<std::string> known;
        for (const auto& one : program.commands) known.push_back(one.name);
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

// The error of a wrong command line, with the usage of the command.
problem unfit(const command_line::app& app, const command_line::parse_error& wrong) {
    const auto* chosen = app.chosen();
    if (!chosen && wrong.why() == command_line::parse_error::reason::no_command)
        return problem(exit_code::usage, "usage", "a command is missing",
                       "ise --help lists them; ise list shows the components that there are");
    const auto& command = chosen ? *chosen : app;
    auto name = chosen ? "ise " + command.name() : std::string("ise");
    auto usage = command.usage(name);
    auto advice = fmt::format("usage:{}\n{} --help says more",
                              usage.substr(usage.find(' '), usage.find('\n') - usage.find(' ')), name);
    if (wrong.why() != command_line::parse_error::reason::extra_word)
        return problem(exit_code::usage, "usage", wrong.what(), advice);
    const auto& word = wrong.extra_word();
    if (!word.starts_with('-'))
        return problem(exit_code::usage, "usage", fmt::format("'{}' is one argument too many", word), advice);
    std::vector<std::string> known;
    for (const auto* of : {&app, &command})
        for (const auto& one : of->info().options)
            for (const auto& each : one.names)
                if (each.starts_with("--")) known.push_back(each);
    auto near = nearest(word, known);
    return problem(exit_code::usage, "usage",
                   fmt::format("'{}' has no option '{}'{}", name, word,
                               near.empty() ? "" : fmt::format(", did you mean '{}'?", near.front())),
                   advice);
}

} // namespace

parsed_command read_command_line(int count, const char* const* arguments) {
    parsed_command made;
    command_line::app app("Inspects, calls, monitors and starts components.", "ise");
    add_common_options(app, made.set);
    add_commands(app, made);
    refuse_unknown_command(app, count, arguments);
    try {
        app.parse(count, arguments);
    } catch (const command_line::parse_error& wrong) {
        if (wrong.why() != command_line::parse_error::reason::asked) throw unfit(app, wrong);
        made.text = wrong.what();
        return made;
    }
    if (made.patience && app.get_option("--timeout")->count() == 0) made.set.timeout = *made.patience;
    return made;
}

} // namespace ise::cli
