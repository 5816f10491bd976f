#include <components/boat/telecommand.hpp>

#include <components/boat/layout.hpp>

#include <fmt/format.h>

namespace atirma {

using layout::reader;
using layout::writer;

ise::bytes encode_telecommand(const telecommand& command) {
    packet_header header;
    header.sequence = command.id; // a command's id stands where a packet's sequence does
    header.measured_at = command.sent_at;
    writer out(command.authority == 0 ? layout::telecommand_type : layout::authorised_type, header);
    if (command.authority != 0) out.integer(command.authority);
    out.enumerator(command.kind);
    switch (command.kind) {
        case command_kind::set_mode: out.enumerator(command.mode); break;
        case command_kind::waypoint_add: out.point(command.point); break;
        case command_kind::waypoint_insert:
            out.integer(command.index);
            out.point(command.point);
            break;
        case command_kind::waypoint_delete:
        case command_kind::waypoint_select: out.integer(command.index); break;
        case command_kind::set_parameter:
            out.enumerator(command.parameter);
            out.real(command.value);
            break;
        case command_kind::get_parameter: out.enumerator(command.parameter); break;
        case command_kind::set_telemetry_period:
            out.enumerator(command.link);
            out.real(command.period_s);
            break;
        case command_kind::emergency_beacon: out.integer(static_cast<std::uint8_t>(command.on ? 1 : 0)); break;
        case command_kind::ping:
        case command_kind::waypoint_clear:
        case command_kind::waypoint_read_back:
        case command_kind::tack_now:
        case command_kind::gybe_now:
        case command_kind::request_status:
        case command_kind::reboot: break;
    }
    return out.finish();
}

ise::result<telecommand> parse_telecommand(ise::bytes_view raw) {
    reader in(raw);
    if (in.ok() && in.type != layout::telecommand_type && in.type != layout::authorised_type) in.fail(fmt::format("a packet of type {:02X} is not a telecommand", in.type));
    telecommand command;
    command.id = in.header.sequence;
    command.sent_at = in.header.measured_at;
    if (in.type == layout::authorised_type) command.authority = in.integer<std::uint32_t>();
    command.kind = in.any_enumerator<command_kind>();
    if (in.ok() && !is_known(command.kind)) return command; // a newer shore: its arguments are not ours to read
    switch (command.kind) {
        case command_kind::set_mode: command.mode = in.any_enumerator<sailing_mode>(); break;
        case command_kind::waypoint_add: command.point = in.point("waypoint"); break;
        case command_kind::waypoint_insert:
            command.index = in.integer<std::uint8_t>();
            command.point = in.point("waypoint");
            break;
        case command_kind::waypoint_delete:
        case command_kind::waypoint_select: command.index = in.integer<std::uint8_t>(); break;
        case command_kind::set_parameter:
            command.parameter = in.any_enumerator<parameter_id>();
            command.value = in.real("value");
            break;
        case command_kind::get_parameter: command.parameter = in.any_enumerator<parameter_id>(); break;
        case command_kind::set_telemetry_period:
            command.link = in.any_enumerator<link_id>();
            command.period_s = in.real("period");
            break;
        case command_kind::emergency_beacon: command.on = in.integer<std::uint8_t>() != 0; break;
        case command_kind::ping:
        case command_kind::waypoint_clear:
        case command_kind::waypoint_read_back:
        case command_kind::tack_now:
        case command_kind::gybe_now:
        case command_kind::request_status:
        case command_kind::reboot: break;
    }
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
    if (in.ok() && in.type != layout::acknowledgement_type && !with_epoch) in.fail(fmt::format("a packet of type {:02X} is not an acknowledgement", in.type));
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
    if (type == layout::telecommand_type || type == layout::authorised_type) return packet_class::telecommand;
    if (type == layout::acknowledgement_type || type == layout::authorised_acknowledgement_type)
        return packet_class::acknowledgement;
    if (type == layout::receipt_type) return packet_class::receipt;
    return packet_class::unknown;
}

} // namespace atirma
