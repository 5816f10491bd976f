#include <components/xbee/framing.hpp>

#include <fmt/format.h>

namespace atirma::xbee {
namespace {

frame_scan refuse(refusal reason, std::string message) {
    frame_scan scan;
    scan.state = scan_state::refused;
    scan.reason = reason;
    scan.message = std::move(message);
    return scan;
}

enum class got : std::uint8_t { byte, none, bad_escape, delimiter };

// One byte of the frame after the delimiter, unescaped.
got next(ise::bytes_view wire, std::size_t& at, api_mode mode, std::uint8_t& out) {
    if (at >= wire.size()) return got::none;
    out = std::to_integer<std::uint8_t>(wire[at]);
    if (mode == api_mode::plain) return ++at, got::byte;
    if (out == 0x7E) return got::delimiter;
    if (out != 0x7D) return ++at, got::byte;
    if (at + 1 >= wire.size()) return got::none;
    out = std::to_integer<std::uint8_t>(wire[at + 1]);
    if (out == 0x7E) return got::delimiter;
    out ^= 0x20;
    if (!is_special(out)) return got::bad_escape;
    at += 2;
    return got::byte;
}

} // namespace

std::string_view name_of(refusal reason) noexcept {
    switch (reason) {
        case refusal::no_delimiter: return "no_delimiter";
        case refusal::truncated: return "truncated";
        case refusal::bad_length: return "bad_length";
        case refusal::too_short_for_type: return "too_short_for_type";
        case refusal::bad_checksum: return "bad_checksum";
        case refusal::bad_escape: return "bad_escape";
        case refusal::unexpected_delimiter: return "unexpected_delimiter";
        case refusal::trailing_bytes: return "trailing_bytes";
    }
    return "unknown";
}

frame_scan scan_frame(ise::bytes_view wire, api_mode mode) {
    frame_scan scan;
    if (wire.empty()) return scan;
    if (wire[0] != std::byte{0x7E})
        return refuse(refusal::no_delimiter,
                      fmt::format("a frame starts with 7E, not {:02X}", std::to_integer<unsigned>(wire[0])));

    std::size_t at = 1, length = 0, taken = 0;
    std::uint8_t sum = 0;
    for (;;) {
        std::uint8_t b = 0;
        switch (next(wire, at, mode, b)) {
            case got::none: return scan;
            case got::delimiter:
                return refuse(refusal::unexpected_delimiter,
                              fmt::format("another frame starts at byte {} of this one", at));
            case got::bad_escape:
                return refuse(refusal::bad_escape,
                              fmt::format("7D at byte {} stands before {:02X}, which is never escaped", at, b ^ 0x20u));
            case got::byte: break;
        }
        ++taken;
        if (taken <= 2) {
            length = (length << 8) | b;
            if (taken == 2 && (length == 0 || length > max_frame_data))
                return refuse(refusal::bad_length,
                              fmt::format("a frame of {} bytes; 1 to {} are possible", length, max_frame_data));
            continue;
        }
        sum = static_cast<std::uint8_t>(sum + b);
        if (taken < length + 3) {
            scan.data.push_back(std::byte{b});
            continue;
        }
        if (sum != 0xFF)
            return refuse(refusal::bad_checksum,
                          fmt::format("the checksum is {:02X}, the data want {:02X}", b,
                                      static_cast<std::uint8_t>(0xFF - static_cast<std::uint8_t>(sum - b))));
        scan.state = scan_state::complete;
        scan.wire_size = at;
        return scan;
    }
}

} // namespace atirma::xbee
