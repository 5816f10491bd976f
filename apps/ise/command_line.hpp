#pragma once
#include "conversation.hpp"

namespace ise::cli {

/// Reads the command line, and standard input where it says `-`. Throws problem(usage).
wish read_command_line(int count, const char* const* arguments);

} // namespace ise::cli
