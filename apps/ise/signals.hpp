#pragma once
#include <vector>

namespace ise::cli {

/// The signals that end a command: Ctrl-C, and others of the system.
std::vector<int> ending_signals();

} // namespace ise::cli
