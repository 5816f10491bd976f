#pragma once
#include <string>
#include <vector>

namespace ise::cli {

/// An option or a place of the command line, as completion scripts need it.
struct option_info {
    std::vector<std::string> names; ///< "--json", "-n"; of a place one: "NAME"
    std::string description;
    bool takes_value = false;
    std::vector<std::string> choices;
};

/// A command with everything below it.
struct command_info {
    std::string name;
    std::string description;
    std::vector<option_info> options;
    std::vector<option_info> places;
    std::vector<command_info> commands;
};

/// The script that completes `ise` in a shell ("bash", "zsh" or "fish"), made from its commands. Names of components
/// and services are completed by asking the running ones, quietly and for a second at most.
std::string completion_script(const command_info& program, const std::string& shell);

} // namespace ise::cli
