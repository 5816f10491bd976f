#pragma once
#include "command.hpp"

#include <optional>
#include <string>
#include <string_view>
#include <vector>

/// Options that several commands have.
namespace ise::cli {

inline constexpr const char* component_name = "path of a component, or endpoint such as tcp://127.0.0.1:7411";

void add_component(command_line::app& app, std::string& name);
/// "only this path and what is below it"
void add_prefix(command_line::app& app, std::string& prefix);
/// `-n`: a whole number from 1 on.
command_line::option* add_count(command_line::app& app, std::optional<std::uint64_t>& into,
                                const std::string& description);
/// A time longer than nothing; else problem(usage).
command_line::option* add_time(command_line::app& app, const std::string& name, duration& into,
                               const std::string& description);
command_line::option* add_time(command_line::app& app, const std::string& name, std::optional<duration>& into,
                               const std::string& description);
/// Texts NAME=VALUE, one with each time that the option is given.
command_line::option* add_each(command_line::app& app, const std::string& name, std::vector<std::string>& into,
                               const std::string& description, const std::string& type = "NAME=VALUE");
/// The parts of such a text; problem(usage) that names the option.
std::pair<std::string, std::string> name_and_value(const std::string& text, std::string_view option,
                                                   std::string_view type = "NAME=VALUE");
/// As command_line::is_member, for people: "'tcsh' is none of bash, zsh, fish".
command_line::validator one_of(std::vector<std::string> choices);

/// What was given as a request: `{}` for nothing, standard input for `-`.
std::string json_given(const std::string& text);

} // namespace ise::cli
