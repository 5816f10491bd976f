#pragma once
#include <string>
#include <string_view>
#include <vector>

namespace ise {

/// Those of `known` that `wanted` may have meant, nearest first, at most three: for messages.
std::vector<std::string> nearest(std::string_view wanted, const std::vector<std::string>& known);

} // namespace ise
