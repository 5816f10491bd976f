#include <components/boat/telecommand.hpp>

#include <components/boat/layout.hpp>
#include <components/boat/raw_payload.hpp>

#include <ise/core/time_text.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <chrono>

namespace atirma {

using layout::reader;
using layout::writer;

namespace {

// How an argument lies on air, by its type.
template <class T>
void put_argument(writer& out, const T& value) {
    if constexpr (std::is_enum_v<T>) out.enumerator(value);
    else if constexpr (std::is_same_v<T, bool>) out.integer(static_cast<std::uint8_t>(value ? 1 : 0));
    else if constexpr (std::is_same_v<T, float>) out.real(value);
    else if constexpr (std::is_same_v<T, waypoint>) out.point(value);
    else if constexpr (std::is_same_v<T, std::string>) {
        auto checked = payload_bytes(value); // a wrong one is refused before
        auto raw = checked ? std::move(*checked) : ise::bytes();
        out.integer(static_cast<std::uint8_t>(raw.size()));
        for (auto byte : raw) out.integer(std::to_integer<std::uint8_t>(byte));
    } else out.integer(value);
}

template <class T>
void take_argument(reader& in, std::string_view name, T& value) {
    if constexpr (std::is_enum_v<T>) value = in.any_enumerator<T>();
    else if constexpr (std::is_same_v<T, bool>) value = in.integer<std::uint8_t>() != 0;
    else if constexpr (std::is_same_v<T, float>) value = in.real(name);
    else if constexpr (std::is_same_v<T, waypoint>) value = in.point(name);
    else if constexpr (std::is_same_v<T, std::string>) {
        std::size_t size = in.integer<std::uint8_t>();
        if (size > max_raw_bytes)
            return in.fail(fmt::format("{} has {} bytes; {} are possible", name, size, max_raw_bytes));
        ise::bytes raw;
        while (raw.size() < size && in.ok()) raw.push_back(static_cast<std::byte>(in.integer<std::uint8_t>()));
        value = payload_text(raw);
    } else value = in.integer<T>();
}

} // namespace

std::string utc_text(utc_time at) { return ise::iso_8601(at).substr(11); }

ise::bytes encode_telecommand(const telecommand& command) {
    packet_header header;
    header.sequence = command.id; // a command's id stands where a packet's sequence does
    header.measured_at = command.sent_at;
    if (command.valid_for) header.boot = command.clock_of;
    writer out(command.valid_for        ? layout::limited_type
               : command.authority == 0 ? layout::telecommand_type
                                        : layout::authorised_type,
               header);
    if (command.authority != 0 || command.valid_for) out.integer(command.authority);
    if (command.valid_for) {
        auto steps = std::clamp(*command.valid_for, std::chrono::milliseconds(0), telecommand::max_valid_for) / 10;
        out.integer(static_cast<std::uint16_t>(steps.count() & 0xFFFF));
        out.integer(static_cast<std::uint8_t>(steps.count() >> 16));
    }
    out.enumerator(command.command.kind());
    command.command.for_each_argument([&out](std::string_view, const auto& value) { put_argument(out, value); });
    return out.finish();
}

ise::result<telecommand> parse_telecommand(ise::bytes_view raw) {
    reader in(raw);
    bool limited = in.type == layout::limited_type;
    if (in.ok() && in.type != layout::telecommand_type && in.type != layout::authorised_type && !limited)
        in.fail(fmt::format("a packet of type {:02X} is not a telecommand", in.type));
    telecommand command;
    command.id = in.header.sequence;
    command.sent_at = in.header.measured_at;
    if (limited || in.type == layout::authorised_type) command.authority = in.integer<std::uint32_t>();
    if (limited) {
        auto low = in.integer<std::uint16_t>();
        auto high = in.integer<std::uint8_t>();
        command.valid_for = std::chrono::milliseconds(10) * (low | high << 16);
        command.clock_of = in.header.boot;
    }
    command.command = boat_command(in.any_enumerator<command_kind>());
    // A newer shore: its arguments are not ours to read.
    if (in.ok() && command.command.get_if<commands::unknown>()) return command;
    command.command.for_each_argument([&in](std::string_view name, auto& value) { take_argument(in, name, value); });
    if (auto done = in.finish(); !done) return done.error();
    return command;
}

ise::bytes encode_acknowledgement(const acknowledgement& ack) {
    writer out(ack.authority ? layout::authorised_acknowledgement_type : layout::acknowledgement_type, ack.header);
    if (ack.authority) out.integer(*ack.authority);
    out.integer(ack.id);
    out.enumerator(ack.kind);
    out.enumerator(ack.code);
    out.real(ack.value);
    out.text(ack.text, acknowledgement::max_text);
    return out.finish();
}

ise::result<acknowledgement> parse_acknowledgement(ise::bytes_view raw) {
    reader in(raw);
    bool with_epoch = in.type == layout::authorised_acknowledgement_type;
    if (in.ok() && in.type != layout::acknowledgement_type && !with_epoch)
        in.fail(fmt::format("a packet of type {:02X} is not an acknowledgement", in.type));
    acknowledgement ack;
    ack.header = in.header;
    if (with_epoch) ack.authority = in.integer<std::uint32_t>();
    ack.id = in.integer<std::uint32_t>();
    ack.kind = in.any_enumerator<command_kind>();
    ack.code = in.enumerator<ack_code>("result");
    ack.value = in.real("value");
    ack.text = in.text(acknowledgement::max_text);
    if (auto done = in.finish(); !done) return done.error();
    return ack;
}

packet_class classify(ise::bytes_view raw) noexcept {
    if (raw.size() < 2) return packet_class::unknown;
    auto type = std::to_integer<std::uint8_t>(raw[1]);
    if (type >= layout::first_telemetry && type <= layout::last_telemetry) return packet_class::telemetry;
    if (type == layout::telecommand_type || type == layout::authorised_type || type == layout::limited_type)
        return packet_class::telecommand;
    if (type == layout::acknowledgement_type || type == layout::authorised_acknowledgement_type)
        return packet_class::acknowledgement;
    if (type == layout::receipt_type) return packet_class::receipt;
    return packet_class::unknown;
}

} // namespace atirma
