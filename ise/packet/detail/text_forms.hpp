#pragma once
#include <ise/core/bytes.hpp>
#include <ise/packet/type.hpp>

#include <exception>
#include <optional>
#include <string>
#include <string_view>

/// How single values are shown as text, for JSON and for people.
namespace ise::detail {

std::string to_base64(bytes_view raw);
std::optional<bytes> from_base64(std::string_view text);

/// Whether a text is UTF-8 as it should be.
bool is_utf8(std::string_view text) noexcept;
/// Moves a character from the start of `text` to a JSON string: what is no UTF-8 becomes U+FFFD, and what a terminal
/// obeys or does not show (`readable_length`) \uXXXX.
void append_json_letter(std::string& out, std::string_view& text);
/// Appends a JSON string with its quotes, by these letters.
void append_json_string(std::string& out, std::string_view text);
/// The shortest digits that read back as the same number; "NaN", "Infinity", "-Infinity" in quotes.
void append_json_number(std::string& out, double value);
void append_json_number(std::string& out, float value);

/// The message of a JSON library's exception without its name: "[json.exception.parse_error.101] parse error at…".
std::string_view reason_of(const std::exception& why) noexcept;

/// A duration's ticks as seconds, a time point's as ISO 8601 in UTC, both as JSON; "7 ticks" where neither is exact.
void append_json_time(std::string& out, const type_description& type, std::int64_t ticks);
/// The way back from a string: ISO 8601, decimal seconds, or ticks.
std::optional<std::int64_t> ticks_from_text(const type_description& type, std::string_view text);
/// The way back from a number of seconds; nothing where it does not fit.
std::optional<std::int64_t> ticks_from_seconds(const type_description& type, double seconds);

} // namespace ise::detail
