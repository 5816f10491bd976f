#pragma once
#include <ise/core/result.hpp>
#include <ise/core/time.hpp>

#include <string>
#include <string_view>
#include <vector>

namespace ise::cli {

/// "5s", "250ms", "1.5m", "2h"; a bare number means seconds. errc::invalid_argument shows right ones.
result<duration> parse_duration(std::string_view text);
/// "1.25 ms", "3.4 s", "2 h 05 m": three significant digits, for people.
std::string show_duration(duration length);
/// "1.4 MB"
std::string show_bytes(std::uint64_t count);

/// What others wrote, fit for a terminal: no control characters, no broken UTF-8 and, unless `keep_lines`, no line ends.
std::string printable(std::string_view text, bool keep_lines = false);
/// Columns that a text takes, counting code points.
std::size_t columns(std::string_view text);
/// Cut to `width` columns, with "…" where something is missing.
std::string cut(std::string_view text, std::size_t width);

/// Those of `known` that `wanted` may have meant, nearest first, at most three.
std::vector<std::string> nearest(std::string_view wanted, const std::vector<std::string>& known);
/// "a, b and c"
std::string enumerate(const std::vector<std::string>& names);

} // namespace ise::cli
