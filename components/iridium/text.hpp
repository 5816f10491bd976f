#pragma once
#include <ise/core/bytes.hpp>
#include <ise/core/result.hpp>

#include <chrono>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <utility>

namespace atirma::iridium {

/// "48656c6c6f", lower case.
std::string to_hex(ise::bytes_view raw);
/// Either case; at most `most` bytes. Errors: malformed (odd, or no hex digit: says where), too_large.
ise::result<ise::bytes> from_hex(std::string_view text, std::size_t most);

/// base64url without padding, as in a JWT. Error: malformed.
ise::result<std::string> from_base64url(std::string_view text);
std::string to_base64url(std::string_view raw);

using form = std::map<std::string, std::string, std::less<>>;
/// `a=b&c=d%20e`: names and values decoded; `+` is a blank. At most 64 fields; of a name given twice the last counts.
/// Errors: malformed (a bad `%`), too_large.
ise::result<form> parse_form(std::string_view body);
std::string encode_form(std::span<const std::pair<std::string, std::string>> fields);

/// `22-02-01 22:22:40` (of this century) and ISO 8601 `2019-01-31T14:00:13Z`, UTC. Error: malformed.
ise::result<std::chrono::sys_seconds> parse_transmit_time(std::string_view text);
/// The first of these two.
std::string format_transmit_time(std::chrono::sys_seconds at);

/// A whole decimal number within bounds. Error: malformed, naming `what`.
ise::result<std::int64_t> parse_integer(std::string_view what, std::string_view text, std::int64_t least,
                                        std::int64_t most);
/// A finite decimal number within bounds. Error: malformed.
ise::result<double> parse_real(std::string_view what, std::string_view text, double least, double most);

} // namespace atirma::iridium
