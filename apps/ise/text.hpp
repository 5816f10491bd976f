#pragma once
#include <ise/component/nearest.hpp>
#include <ise/core/readable.hpp>
#include <ise/core/result.hpp>
#include <ise/core/time_text.hpp>

#include <string>
#include <string_view>
#include <vector>

namespace ise::cli {

/// "1.25 ms", "3.4 s", "2 h 05 min": three significant digits, for people.
std::string show_duration(duration length);
/// "1.4 MB"
std::string show_bytes(std::uint64_t count);

/// What others wrote, fit for a terminal: no control characters, no broken UTF-8 and, unless `keep_lines`, no line
/// ends.
std::string printable(std::string_view text, bool keep_lines = false);
/// JSON of others on one line, fit for a terminal: its strings have escapes instead. "null" if it is none.
std::string readable_json(std::string_view text);
using ise::columns;
/// Cut to `width` columns, with "…" where something is missing.
std::string cut(std::string_view text, std::size_t width);

/// Every line, and an end of line behind the last.
std::string indented(std::string_view text, std::string_view by);

/// Those first that most can reach: from other hosts, then from this one, then from the same process.
std::vector<std::string> reachable_first(std::vector<std::string> endpoints);

using ise::nearest;
/// "a, b and c"
std::string enumerate(const std::vector<std::string>& names);

/// Whether there is no session because the other side's access policy cannot be used, and what to do then.
bool has_unusable_policy(const std::string& why);
inline constexpr const char* policy_advice =
    "correct the file on its host (ise access check FILE shows what is wrong); it is read again within 5 s";

} // namespace ise::cli
