#include <components/boat/receipt.hpp>

#include <components/boat/layout.hpp>

#include <fmt/format.h>

namespace atirma {
namespace {

constexpr std::size_t max_receipt_bits = telemetry_receipt::span / 8;
static_assert(layout::header_size + 1 + max_receipt_bits + layout::checksum_size <= max_packet_size);

} // namespace

ise::bytes encode_receipt(utc_time sent_at, std::set<packet_name>& packets, std::uint32_t span) {
    const auto [boot, first] = *packets.begin();
    std::vector<std::uint8_t> bits;
    while (!packets.empty()) {
        const auto [of, sequence] = *packets.begin();
        if (of != boot || sequence - first >= span) break;
        bits.resize((sequence - first) / 8 + 1);
        bits.back() = static_cast<std::uint8_t>(bits.back() | 1u << (sequence - first) % 8);
        packets.erase(packets.begin());
    }
    packet_header header;
    header.boot = boot;
    header.sequence = first;
    header.measured_at = sent_at;
    layout::writer out(layout::receipt_type, header);
    out.integer(static_cast<std::uint8_t>(bits.size()));
    for (auto byte : bits) out.integer(byte);
    return out.finish();
}

ise::result<telemetry_receipt> parse_receipt(ise::bytes_view raw) {
    layout::reader in(raw);
    if (in.ok() && in.type != layout::receipt_type)
        in.fail(fmt::format("a packet of type {:02X} is not a receipt", in.type));
    telemetry_receipt made;
    made.sent_at = in.header.measured_at;
    auto bytes = in.integer<std::uint8_t>();
    if (in.ok() && bytes > max_receipt_bits)
        in.fail(fmt::format("a receipt of {} bytes of bits; {} are possible", bytes, max_receipt_bits));
    for (std::uint32_t i = 0; in.ok() && i < bytes; ++i) {
        auto some = in.integer<std::uint8_t>();
        for (std::uint32_t bit = 0; bit < 8; ++bit)
            if ((some >> bit & 1) != 0) made.packets.emplace(in.header.boot, in.header.sequence + i * 8 + bit);
    }
    if (auto done = in.finish(); !done) return done.error();
    return made;
}

} // namespace atirma
