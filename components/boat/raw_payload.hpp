#pragma once
#include <ise/core/bytes.hpp>
#include <ise/core/result.hpp>

#include <cstddef>
#include <string>
#include <string_view>

namespace atirma {

/// Of a raw telecommand, so that it fits one frame of the radio, sealed or not.
inline constexpr std::size_t max_raw_bytes = 64;

/// The bytes that an operator means by "hex:0A 1B" (digits in pairs, blanks between them do not matter) or by any other
/// text (UTF-8, as it is). Errors: invalid_argument: nothing, too many, no hexadecimal digits.
ise::result<ise::bytes> payload_bytes(std::string_view text);
/// The other way: printable ASCII as it is, else "hex:0A1B".
std::string payload_text(ise::bytes_view raw);

} // namespace atirma
