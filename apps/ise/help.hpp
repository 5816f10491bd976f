#pragma once
#include "exit_code.hpp"

#include <string>

namespace CLI {
class App;
class ParseError;
} // namespace CLI

namespace ise::cli {

/// Groups the commands, and gives each its examples and the options that every command has. Once all commands are
/// there.
void complete_help(CLI::App& app);

/// problem(usage) of a command line that CLI11 refused, with the usage of the command.
problem unfit(const CLI::App& app, const CLI::ParseError& wrong);

} // namespace ise::cli
