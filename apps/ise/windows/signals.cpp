#include "../signals.hpp"

#include <csignal>

namespace ise::cli {

std::vector<int> ending_signals() { return {SIGINT, SIGTERM, SIGBREAK}; } // the last: the console was closed

} // namespace ise::cli
