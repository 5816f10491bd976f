// link: atirma_xbee
// Bytes of a serial line into the XBee decoder, in pieces; what it accepts must survive a round trip.
// link: atirma_xbee
#include <components/xbee/decoder.hpp>

#include <algorithm>
#include <cstdlib>

using namespace atirma::xbee;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* input, std::size_t size) {
    if (size < 2) return 0;
    auto mode = input[0] & 1 ? api_mode::plain : api_mode::escaped;
    std::size_t piece = input[1] % 32u + 1u;
    ise::bytes_view rest(reinterpret_cast<const std::byte*>(input + 2), size - 2);

    auto check = [&](const parsed_frame& parsed) {
        auto* f = std::get_if<frame>(&parsed);
        if (!f) return;
        auto again = parse_frame(encode(*f, mode), mode);
        auto* same = std::get_if<frame>(&again);
        if (!same || !(*same == *f)) std::abort();
    };
    check(parse_frame(rest, mode));

    frame_decoder decoder(mode);
    while (!rest.empty()) {
        auto now = rest.first(std::min(piece, rest.size()));
        rest = rest.subspan(now.size());
        decoder.push(now);
        while (auto one = decoder.next()) check(*one);
    }
    decoder.give_up();
    while (auto one = decoder.next()) check(*one);
    if (decoder.in_frame()) std::abort();
    return 0;
}
