// link: atirma_seal
// A frame of the radio into both ends of the seal: without the key nothing may pass; sealed by the key the notice in it
// survives a round trip.
#include <components/seal/boat_seal.hpp>
#include <components/seal/shore_seal.hpp>

#include <cstdlib>

using namespace atirma::seal;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* input, std::size_t size) {
    ise::bytes_view raw(reinterpret_cast<const std::byte*>(input), size);
    radio_key key;
    key.boat = "atirma";
    key.epoch = 1;
    boat_counters known;
    known.of = 9;
    boat_seal boat(key, known, 7, [](const boat_counters&) { return ise::result<void>(); });
    shore_seal shore(key, lane::primary, {9, 1}, [](const shore_counters&) { return ise::result<void>(); });
    if (boat.open(raw) || shore.open(raw)) std::abort();
    if (auto notice = parse_notice(raw))
        if (parse_notice(encode_notice(*notice)).value() != *notice) std::abort();
    if (auto read = parse_key(ise::as_text(raw), "file"))
        if (parse_key(format_key(*read), "file").value().secret != read->secret) std::abort();
    if (raw.size() >= 16 && raw.size() <= 100) {
        auto sealed = shore.seal(raw).value();
        auto opened = boat.open(sealed);
        if (raw[1] != std::byte{ask_type} && (!opened || opened->size() != raw.size())) std::abort();
        if (boat.open(sealed)) std::abort();
    }
    return 0;
}
