#pragma once
#include "command_line.hpp"

#include <string>

namespace ise::cli {

/// The script that completes `ise` in a shell ("bash", "zsh" or "fish"), made from its commands. Names of components
/// and services are completed by asking the running ones, quietly and for a second at most.
std::string completion_script(const command_info& program, const std::string& shell);

} // namespace ise::cli
