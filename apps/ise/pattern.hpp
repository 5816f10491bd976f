#pragma once
#include <string>
#include <string_view>

namespace ise::cli {

/// Whether a name has wildcards: `*` and `?` within a part of a path, `**` for any number of parts.
bool is_pattern(std::string_view name) noexcept;
/// "atirma/**" matches "atirma/boat" and "atirma/shore/xbee", "atirma/*" only the first of them, "**" everything.
bool matches(std::string_view pattern, std::string_view path) noexcept;
/// What every match begins with: "atirma" of "atirma/*/xbee".
std::string prefix_of(std::string_view pattern);

} // namespace ise::cli
