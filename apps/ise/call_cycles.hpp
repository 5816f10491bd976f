#pragma once
#include "findings.hpp"

#include <vector>

namespace ise::cli {

/// Calls that wait for one another, and none of which can go on before another one does: one finding a cycle, with its
/// components, services and the lines that wait. Calls through components that did not answer are not followed.
std::vector<finding> examine_calls(const std::vector<surveyed>& now);

} // namespace ise::cli
