// ise completion: the script that completes `ise` in a shell, made from its commands. Names of components and services
// are completed by asking the running ones, quietly and for a second at most.
#include "completion_scripts.hpp"
#include "options.hpp"

#include <fmt/format.h>

#include <memory>
#include <set>
#include <string_view>
#include <utility>

namespace ise::cli {
namespace {

using command_line::command_info;
using command_line::option_info;

std::string filled(std::string script, std::string_view place, const std::string& text) {
    if (auto at = script.find(place); at != std::string::npos) script.replace(at, place.size(), text);
    return script;
}

// Between single quotes; `:` parts name and description for zsh.
std::string quoted(const std::string& text, std::string_view quote, bool escape_colons = false) {
    std::string out = "'";
    for (char letter : text) {
        if (letter == '\'') out += quote;
        else if (letter == ':' && escape_colons) out += "\\:";
        else out += letter;
    }
    return out + "'";
}

std::set<std::string> options_with_values(const command_info& from) {
    std::set<std::string> names;
    for (const auto& one : from.options)
        if (one.takes_value) names.insert(one.names.begin(), one.names.end());
    for (const auto& below : from.commands) names.merge(options_with_values(below));
    return names;
}

std::string joined(const std::set<std::string>& names, std::string_view between) {
    std::string text;
    for (const auto& name : names) text += (text.empty() ? "" : std::string(between)) + name;
    return text;
}

// What completes a place: its name, which the scripts know, or its choices.
std::string place_word(const option_info& place) {
    constexpr std::string_view another = "OTHER_"; // of the same sort as the first
    if (place.choices.empty())
        return place.names.front().substr(place.names.front().starts_with(another) ? another.size() : 0);
    std::string words;
    for (const auto& one : place.choices) words += (words.empty() ? "" : " ") + one;
    return words;
}

// Words for a JSON text, a value or a new path, are the user's own.
bool completes(const option_info& place) {
    const auto& name = place.names.front();
    return name != "JSON" && name != "PATH" && name != "VALUE";
}

std::vector<option_info> all_options(const command_info& program, const command_info& command) {
    auto all = command.options;
    for (const auto& global : program.options) {
        bool known = false;
        for (const auto& own : command.options) known = known || own.names == global.names;
        if (!known) all.push_back(global);
    }
    return all;
}

std::string bash_case(const command_info& program, const command_info& command, bool top) {
    std::string options, places;
    for (const auto& one : all_options(program, command))
        for (const auto& name : one.names) options += (options.empty() ? "" : " ") + name;
    for (const auto& below : command.commands) places += (places.empty() ? "" : " ") + below.name;
    if (!places.empty()) places = "\"" + places + "\"";
    for (const auto& place : command.arguments)
        places += fmt::format("{}\"{}\"", places.empty() ? "" : " ", completes(place) ? place_word(place) : "");
    return fmt::format("        {}) options=\"{}\" places=({}) ;;\n", top ? "\"\"" : command.name, options, places);
}

std::string zsh_case(const command_info& program, const command_info& command, bool top) {
    std::string options, places;
    for (const auto& one : all_options(program, command))
        for (const auto& name : one.names)
            options += fmt::format("{} ", quoted(fmt::format("{}\n{}", name, one.description), "'\\''", true)
                                              .replace(1 + name.size(), 1, 1, ':'));
    if (top) {
        std::string commands;
        for (const auto& below : command.commands)
            commands += fmt::format("{} ", quoted(fmt::format("{}:{}", below.name, below.description), "'\\''"));
        return fmt::format("        \"\") options=({}) places=(COMMAND); local -a commands=({}) ;;\n", options,
                           commands);
    }
    for (const auto& place : command.arguments)
        places += fmt::format("\"{}\" ", completes(place) ? place_word(place) : "");
    return fmt::format("        {}) options=({}) places=({}) ;;\n", command.name, options, places);
}

std::string fish_option(const option_info& one, const std::string& condition) {
    std::string line = "complete -c ise" + condition;
    for (const auto& name : one.names)
        line += name.starts_with("--") ? " -l " + name.substr(2) : " -s " + name.substr(1);
    if (one.takes_value) line += " -x";
    return line + " -d " + quoted(one.description, "\\'") + "\n";
}

std::string fish_lines(const command_info& program) {
    std::string lines;
    for (const auto& global : program.options) lines += fish_option(global, "");
    for (const auto& command : program.commands) {
        lines += fmt::format("complete -c ise -n '__ise_at \"\"' -a {} -d {}\n", command.name,
                             quoted(command.description, "\\'"));
        for (const auto& one : command.options)
            if (one.names.front() != "--help")
                lines += fish_option(one, fmt::format(" -n '__ise_at {}'", command.name));
        for (std::size_t at = 0; at < command.arguments.size(); ++at) {
            const auto& place = command.arguments[at];
            if (!completes(place)) continue;
            if (place.names.front() == "FILE") {
                lines += fmt::format("complete -c ise -n '__ise_at {} {}' -F\n", command.name, at);
                continue;
            }
            auto words = place.choices.empty() ? fmt::format("(__ise_names {})", place_word(place)) : place_word(place);
            lines += fmt::format("complete -c ise -n '__ise_at {} {}' -a '{}'\n", command.name, at, words);
        }
    }
    return lines;
}

std::string completion_script(const command_info& program, const std::string& shell) {
    auto values = options_with_values(program);
    if (shell == "fish")
        return filled(filled(fish_script, "@VALUES@", joined(values, " ")), "@LINES@", fish_lines(program));
    auto one_case = shell == "zsh" ? zsh_case : bash_case;
    auto cases = one_case(program, program, true);
    for (const auto& command : program.commands) cases += one_case(program, command, false);
    return filled(
        filled(shell == "zsh" ? zsh_script : bash_script, "@VALUES@", joined(values, shell == "zsh" ? "|" : " | ")),
        "@CASES@", cases);
}

void declare_completion(command_line::app& app, parsed_command& made) {
    auto shell = std::make_shared<std::string>();
    app.add_option("SHELL", *shell, "bash, zsh or fish")->required()->check(one_of({"bash", "zsh", "fish"}));
    app.callback([&app, &made, shell] { made.text = completion_script(app.parent()->info(), *shell); });
}

} // namespace

extern const command completion_command{"completion", shell_group, "prints a completion script for a shell",
                                        "  eval \"$(ise completion bash)\"\n  ise completion fish | source\n",
                                        declare_completion};

} // namespace ise::cli
