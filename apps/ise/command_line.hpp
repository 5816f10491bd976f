#pragma once
#include "conversation.hpp"

#include <functional>
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

/// What the user wants: a conversation, or a text that is there already.
struct wish {
    settings set;
    conversation talk;  ///< empty: print `text`
    std::string text;
};

/// Reads the command line, and standard input where it says `-`. Throws problem(usage).
wish read_command_line(int count, const char* const* arguments);

} // namespace ise::cli
