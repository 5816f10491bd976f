#pragma once
#include <cstddef>
#include <string>
#include <string_view>

namespace ise {

inline constexpr std::size_t longest_readable = 8 * 1024; ///< bytes

/// Bytes of the UTF-8 character at the start of `text`. 0: there is none, or one that a terminal obeys or does not show.
std::size_t readable_length(std::string_view text) noexcept;

/// One line for a terminal or a log, whatever a peer's text holds: bytes that are no UTF-8 as \xNN, characters that a terminal
/// obeys or does not show as \u{N}, line ends and tabs as spaces; cut at `longest_readable`.
std::string readable(std::string_view line);

} // namespace ise
