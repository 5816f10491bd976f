#pragma once
#include <ise/core/result.hpp>

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

// What stands in the lines of IMAP, as far as a mailbox needs it. Pure.
namespace atirma {

/// Digits and nothing else, up to 32 bits.
std::optional<std::uint32_t> imap_number(std::string_view digits) noexcept;

/// A quoted string: `"INBOX"`. Errors: invalid_argument for what cannot stand in one (other than printable ASCII).
ise::result<std::string> imap_quoted(std::string_view text);

/// Whether a reply's text begins with this word, whatever its case: "OK", "SEARCH".
bool imap_begins(std::string_view text, std::string_view word) noexcept;

/// "SEARCH 3 5 8" → those numbers; nothing where it is another reply, or broken.
std::optional<std::vector<std::uint32_t>> imap_found(std::string_view text);

/// "12 EXISTS" → 12: so many mails lie in the folder now.
std::optional<std::uint32_t> imap_exists(std::string_view text) noexcept;

/// The value of a response code: "UIDVALIDITY" in "OK [UIDVALIDITY 17] …" → "17". Empty for one without a value.
std::optional<std::string_view> imap_code(std::string_view text, std::string_view name) noexcept;

/// Whether a "CAPABILITY …" reply names it.
bool imap_has_capability(std::string_view text, std::string_view name) noexcept;

/// The number of the mail that a "5 FETCH (UID 7 BODY[]<0> {120})" is about.
std::optional<std::uint32_t> imap_fetched_uid(std::string_view text) noexcept;

/// A server's line for a message to people: cut, control characters as blanks.
std::string imap_shown(std::string_view line);

} // namespace atirma
