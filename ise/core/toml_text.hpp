#pragma once
#include <cstdint>
#include <optional>
#include <string_view>

namespace ise {

struct text_place {
    std::uint32_t line = 1, column = 1; ///< in bytes
};

inline constexpr const char* stray_character_text =
    "a character that is not ASCII is allowed in strings and comments only";

/// Where a text in TOML has a character beyond ASCII that is neither in a string nor in a comment, or that is the first
/// one of a string which a backslash continued on that line. TOML does not allow the former, and toml++ 3.3 is
/// undefined for both, so a text is looked through before it is parsed.
std::optional<text_place> stray_character(std::string_view toml);

} // namespace ise
