// link: atirma_gprs
// Bytes of a connection, in pieces, into the reader of lines and into a shore that has a boat and a stranger. What is a
// line survives a round trip; whatever comes, memory stays bounded.

#include <components/gprs/shore.hpp>

#include <algorithm>
#include <cstdlib>

using namespace atirma::gprs;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* input, std::size_t size) {
    if (size < 1) return 0;
    std::size_t piece = input[0] % 64u + 1u;
    ise::bytes_view all(reinterpret_cast<const std::byte*>(input + 1), size - 1);

    line_reader reader;
    shore land;
    ise::time_point now{std::chrono::hours(1)};
    way boat, stranger, address;
    boat.channel = 1;
    stranger.channel = 2;
    address.channel = 3;
    address.datagrams = true;
    land.connected(now, boat);
    land.on_bytes(now, boat.channel, ise::as_bytes(encode(login{"atirma", 1, 1, 0})));
    land.connected(now, stranger);
    for (auto rest = all; !rest.empty();) {
        auto part = rest.first(std::min(piece, rest.size()));
        rest = rest.subspan(part.size());
        reader.push(part);
        for (;;) {
            auto one = reader.next();
            if (!one) break;
            if (!*one) continue;
            auto text = encode(**one);
            text.resize(text.size() - 2);
            auto again = parse(text);
            if (!again || !(*again == **one)) std::abort();
        }
        if (reader.held() > max_line + 1) std::abort();
        land.on_bytes(now, boat.channel, part);
        land.on_bytes(now, stranger.channel, part);
        land.on_datagram(now, address, part);
        while (auto event = land.take_event())
            if (const auto* came = std::get_if<record_came>(&*event)) land.safe(came->life, {came->number});
        now += std::chrono::seconds(1);
        land.on_time(now);
        if (land.strangers() > 1) std::abort();
    }
    return 0;
}
