#pragma once
#include <components/xbee/frame.hpp>

namespace atirma::xbee {

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
