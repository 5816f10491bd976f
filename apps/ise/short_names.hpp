#pragma once
#include <cstddef>
#include <string>
#include <vector>

namespace ise::cli {

/// The names in columns of `width` (from 4 on), each still told from all others: the first parts of a path become
/// their first letters ("a/s/node-1"), then what is left is cut in the middle, and those that are equal then end in
/// "~2". The order is kept; equal names stay equal.
std::vector<std::string> short_names(const std::vector<std::string>& names, std::size_t width);

} // namespace ise::cli
