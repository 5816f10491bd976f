// link: atirma_iridium
// What the world sends to the Iridium components: DirectIP, RockBLOCK's posts and answers, tokens, AT lines, HTTP. What
// is accepted must survive a round trip.
#include <components/iridium/bundle.hpp>
#include <components/iridium/directip.hpp>
#include <components/iridium/rockblock.hpp>
#include <components/iridium/sbd_client.hpp>
#include <components/iridium/text.hpp>
#include <ise/http/http_reader.hpp>

#include <algorithm>
#include <cstdlib>

using namespace atirma;
using namespace atirma::iridium;

namespace {

void require(bool holds) {
    if (!holds) std::abort();
}

void directip(ise::bytes_view raw) {
    if (auto read = parse_directip_mo(raw)) {
        auto again = parse_directip_mo(encode_directip_mo(*read));
        require(again && again->data == read->data && again->imei == read->imei && again->momsn == read->momsn);
    }
    if (auto read = parse_directip_mt(raw)) require(parse_directip_mt(encode_directip_mt(*read)).value() == *read);
    if (auto read = parse_mt_confirmation(raw))
        require(parse_mt_confirmation(encode_mt_confirmation(*read)).value() == *read);
    (void)parse_mo_confirmation(raw).has_value();
}

void posts(std::string_view text) {
    if (auto read = parse_mo_delivery(text)) {
        require(read->message.data.size() <= max_mo_bytes);
        for (const auto& body : {encode_mo_form(*read), encode_mo_json(*read)}) {
            auto again = parse_mo_delivery(body);
            require(again && again->message.data == read->message.data && again->message.imei == read->message.imei);
        }
    }
    if (auto read = parse_mt_reply(text)) require(parse_mt_reply(encode_mt_reply(*read)).has_value());
    (void)parse_mt_submission(text).has_value();
    (void)from_base64url(text).has_value();
    if (auto read = parse_sbdix(text)) require(parse_sbdix(encode_sbdix(*read)).value() == *read);
}

/// A modem that says anything at any time.
void modem(ise::bytes_view raw, std::size_t piece) {
    sbd_client client;
    ise::time_point now{};
    client.start(now);
    (void)client.send(now, ise::bytes(3)).has_value();
    for (int steps = 0; !raw.empty() && steps < 1000; ++steps) {
        auto part = raw.first(std::min(piece, raw.size()));
        raw = raw.subspan(part.size());
        client.on_bytes(now, part);
        client.take_output();
        while (auto event = client.take_event())
            if (auto* got = std::get_if<sbd_received>(&*event)) require(got->data.size() <= max_mt_bytes);
        if (steps % 4 == 3) {
            now = std::max(now, std::min(client.next_event(), now + std::chrono::minutes(10)));
            client.on_time(now);
        }
    }
}

void http(ise::bytes_view raw, std::size_t piece, ise::http_reader::reads what) {
    ise::http_reader_limits limits;
    limits.max_body_bytes = 500;
    ise::http_reader reader(what, limits);
    for (int messages = 0; !raw.empty() && messages < 100;) {
        auto used = reader.feed(raw.first(std::min(piece, raw.size())));
        if (!used) return;
        raw = raw.subspan(*used);
        if (!reader.complete()) {
            require(*used > 0);
            continue;
        }
        ++messages;
        require(reader.take().body.size() <= limits.max_body_bytes);
    }
    if (reader.begun()) (void)reader.end().has_value();
}

} // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* input, std::size_t size) {
    if (size < 2) return 0;
    std::size_t piece = input[1] % 64u + 1u;
    ise::bytes_view raw(reinterpret_cast<const std::byte*>(input + 2), size - 2);
    switch (input[0] % 6u) {
        case 0: directip(raw); break;
        case 1: posts(ise::as_text(raw)); break;
        case 2: modem(raw, piece); break;
        case 3: http(raw, piece, ise::http_reader::reads::requests); break;
        case 4: http(raw, piece, ise::http_reader::reads::answers); break;
        default: (void)unbundle(raw).has_value();
    }
    return 0;
}
