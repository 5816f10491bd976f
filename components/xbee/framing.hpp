#pragma once
#include <ise/core/bytes.hpp>

#include <cstdint>
#include <string>
#include <string_view>

/// Where a frame begins and ends on the wire; what stands in it is for frame.hpp.
namespace atirma::xbee {

/// The modem's AP parameter, as far as it concerns framing.
enum class api_mode : std::uint8_t {
    plain = 1,   ///< AP=1: bytes as they are
    escaped = 2, ///< AP=2: 7E 7D 11 13 are escaped everywhere after the delimiter
};

inline constexpr std::size_t max_frame_data = 1024; ///< larger than any frame of an XBee; bounds the decoder

/// Why bytes are no frame.
enum class refusal : std::uint8_t {
    no_delimiter,       ///< the first byte is not 7E
    truncated,          ///< the bytes end before the checksum
    bad_length,         ///< a length of zero, or above the bound
    too_short_for_type, ///< a known type whose fixed fields do not fit in
    bad_checksum,
    bad_escape,           ///< AP=2: 7D before a byte that is never escaped
    unexpected_delimiter, ///< AP=2: 7E inside a frame
    trailing_bytes,       ///< one frame was expected and more followed
};
std::string_view name_of(refusal reason) noexcept;

/// Bytes that AP=2 escapes as 7D, b XOR 20.
constexpr bool is_special(std::uint8_t b) { return b == 0x7E || b == 0x7D || b == 0x11 || b == 0x13; }

enum class scan_state : std::uint8_t { complete, incomplete, refused };

/// What stands at the start of some bytes of the wire.
struct frame_scan {
    scan_state state = scan_state::incomplete;
    refusal reason = refusal::truncated; ///< only where refused
    std::string message;                 ///< only where refused
    ise::bytes data;                     ///< only where complete: frame data, unescaped, checksum verified
    std::size_t wire_size = 0;           ///< only where complete: bytes of the wire that the frame took
};

/// Looks at the frame that begins with the first byte of `wire`. A raw 11 or 13 inside an AP=2 frame is taken as it
/// is (real modules send it, and no other byte could be meant); a raw 7E is the start of another frame.
frame_scan scan_frame(ise::bytes_view wire, api_mode mode);

} // namespace atirma::xbee
