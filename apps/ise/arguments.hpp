#pragma once
#include "commands.hpp"

#include <string>
#include <string_view>
#include <vector>

namespace CLI {
class App;
class Validator;
} // namespace CLI

// What the options of several commands have in common.
namespace ise::cli {

/// Of the options that all subscribing commands have.
void add_subscription(CLI::App& command, subscribe_choice& what, std::string& json);
/// Like CLI::IsMember and CLI::PositiveNumber, for people: "'tcsh' is none of bash, zsh, fish".
CLI::Validator one_of(std::vector<std::string> choices);
CLI::Validator positive_count();
/// What stands for a request: `{}` where nothing was given, standard input for `-`.
std::string json_given(const std::string& text);
/// A time that was given to an option; problem(usage) if it is none.
duration positive_time(const std::string& text, std::string_view option);

} // namespace ise::cli
