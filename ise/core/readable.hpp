#pragma once
#include <cstddef>
#include <string>
#include <string_view>

namespace ise {

inline constexpr std::size_t max_readable = 8 * 1024; ///< bytes

/// Bytes of the UTF-8 character at the start of `text`. 0: there is none, or one that a terminal obeys or does not
/// show.
std::size_t readable_length(std::string_view text) noexcept;

/// One line for a terminal or a log, whatever a peer's text holds: bytes that are no UTF-8 as \xNN, characters that a
/// terminal obeys or does not show as \u{N}, line ends and tabs as spaces; cut at `max_bytes`, with "..." behind.
std::string readable(std::string_view line, std::size_t max_bytes = max_readable);

/// Columns of a terminal that a UTF-8 text takes, counting code points.
std::size_t columns(std::string_view text) noexcept;

inline constexpr std::size_t help_width = 80; ///< columns of a terminal that was never made larger

/// Lines of at most `width` columns. A longer one goes on under its text: behind its first gap of two spaces, where it
/// has one ("  --option   what it does"). A word that is longer goes on behind one of its commas, or where the line is
/// full.
std::string wrapped(std::string_view text, std::size_t width = help_width);

} // namespace ise
