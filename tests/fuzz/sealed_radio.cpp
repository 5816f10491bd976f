// link: atirma_seal
// A frame of the radio into both ends of the seal, also while the key is changed: without the key nothing may pass;
// notices, changes of the key and key files that are read survive a round trip.
#include <components/seal/boat_ring.hpp>
#include <components/seal/key_file.hpp>
#include <components/seal/shore_ring.hpp>

#include <algorithm>
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
    if (auto read = parse_keys(ise::as_text(raw), "file")) {
        auto again = parse_keys(format_keys(*read), "file").value();
        if (again.now.secret != read->now.secret || again.next.has_value() != read->next.has_value() ||
            again.recovery != read->recovery)
            std::abort();
    }
    if (auto read = parse_recovery_key(ise::as_text(raw), "file")) {
        auto again = parse_recovery_key(format_recovery_key(*read), "file").value();
        if (again.key.secret != read->key.secret || again.generation != read->generation) std::abort();
    }
    if (auto next = parse_rekey(raw, key))
        if (auto content = rekey_content(*next); !std::equal(content.begin(), content.end(), raw.begin(), raw.end()))
            std::abort();
    auto next = key, recovery = key;
    next.epoch = 2;
    recovery.secret.fill(std::byte{5});
    shore_ring changing(shore, shore_seal(next, lane::primary, {}, [](const auto&) { return ise::result<void>(); }), {},
                        false);
    boat_keys keys{key, next, false, 0};
    auto end = [](const radio_key& of) -> ise::result<boat_seal> {
        boat_counters counted;
        counted.of = 9;
        return boat_seal(of, counted, 7, [](const boat_counters&) { return ise::result<void>(); });
    };
    auto changed = boat_ring::make(keys, recovery, {"xbee"}, end, [](const auto&) { return ise::result<void>(); });
    if (changing.open(raw) || changed.value().open(0, raw) || open_recovery(recovery, raw)) std::abort();
    if (raw.size() >= 16 && raw.size() <= 100) {
        auto sealed = shore.seal(raw).value();
        auto opened = boat.open(sealed);
        if (raw[1] != std::byte{ask_type} && (!opened || opened->size() != raw.size())) std::abort();
        if (boat.open(sealed)) std::abort();
    }
    return 0;
}
