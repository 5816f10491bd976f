#include <components/xbee/frame.hpp>

#include <fmt/format.h>

namespace atirma::xbee {
namespace {

std::uint8_t u8(std::byte b) { return std::to_integer<std::uint8_t>(b); }

// Big-endian fields in order; the caller has checked that the fixed part is there.
class field_reader {
public:
    explicit field_reader(ise::bytes_view data) : rest_(data) {}
    template <class U>
    U take() {
        U value = 0;
        for (std::size_t i = 0; i < sizeof(U); ++i) value = static_cast<U>((std::uint64_t{value} << 8) | u8(rest_[i]));
        rest_ = rest_.subspan(sizeof(U));
        return value;
    }
    at_name name() {
        auto first = static_cast<char>(take<std::uint8_t>());
        return {first, static_cast<char>(take<std::uint8_t>())};
    }
    ise::bytes rest() const { return {rest_.begin(), rest_.end()}; }

private:
    ise::bytes_view rest_;
};

class field_writer {
public:
    template <class U>
    field_writer& put(U value) {
        for (std::size_t i = sizeof(U); i-- > 0;)
            out.push_back(static_cast<std::byte>((std::uint64_t{value} >> (8 * i)) & 0xFF));
        return *this;
    }
    field_writer& put(const at_name& name) {
        return put(static_cast<std::uint8_t>(name[0])).put(static_cast<std::uint8_t>(name[1]));
    }
    field_writer& put(const ise::bytes& raw) {
        out.insert(out.end(), raw.begin(), raw.end());
        return *this;
    }
    ise::bytes out;
};

// Type byte and fixed fields; 0 where the type is not known.
std::size_t fixed_size(std::uint8_t type) {
    switch (type) {
        case 0x08:
        case 0x09: return 4;
        case 0x88: return 5;
        case 0x10: return 14;
        case 0x8B: return 7;
        case 0x90: return 12;
        case 0x17: return 15;
        case 0x97: return 15;
        case 0x8A: return 2;
        default: return 0;
    }
}

struct encoder {
    ise::bytes operator()(const at_request& f) const {
        return field_writer().put(type_of(f)).put(f.frame_id).put(f.command).put(f.parameter).out;
    }
    ise::bytes operator()(const at_response& f) const {
        return field_writer()
            .put(type_of(f))
            .put(f.frame_id)
            .put(f.command)
            .put(static_cast<std::uint8_t>(f.status))
            .put(f.value)
            .out;
    }
    ise::bytes operator()(const transmit_request& f) const {
        return field_writer()
            .put(type_of(f))
            .put(f.frame_id)
            .put(f.destination)
            .put(f.network)
            .put(f.radius)
            .put(f.options)
            .put(f.payload)
            .out;
    }
    ise::bytes operator()(const transmit_status& f) const {
        return field_writer()
            .put(type_of(f))
            .put(f.frame_id)
            .put(f.network)
            .put(f.retries)
            .put(static_cast<std::uint8_t>(f.outcome))
            .put(f.discovery)
            .out;
    }
    ise::bytes operator()(const received_packet& f) const {
        return field_writer().put(type_of(f)).put(f.source).put(f.network).put(f.options).put(f.payload).out;
    }
    ise::bytes operator()(const remote_at_request& f) const {
        return field_writer()
            .put(type_of(f))
            .put(f.frame_id)
            .put(f.destination)
            .put(f.network)
            .put(f.options)
            .put(f.command)
            .put(f.parameter)
            .out;
    }
    ise::bytes operator()(const remote_at_response& f) const {
        return field_writer()
            .put(type_of(f))
            .put(f.frame_id)
            .put(f.source)
            .put(f.network)
            .put(f.command)
            .put(static_cast<std::uint8_t>(f.status))
            .put(f.value)
            .out;
    }
    ise::bytes operator()(const modem_status& f) const { return field_writer().put(type_of(f)).put(f.status).out; }
    ise::bytes operator()(const raw_frame& f) const { return field_writer().put(f.type).put(f.body).out; }
};

} // namespace

std::string_view name_of(delivery code) noexcept {
    switch (code) {
        case delivery::success: return "success";
        case delivery::no_ack: return "no_ack";
        case delivery::cca_failure: return "cca_failure";
        case delivery::purged: return "purged";
        case delivery::invalid_endpoint: return "invalid_endpoint";
        case delivery::network_ack_failure: return "network_ack_failure";
        case delivery::not_joined: return "not_joined";
        case delivery::self_addressed: return "self_addressed";
        case delivery::address_not_found: return "address_not_found";
        case delivery::route_not_found: return "route_not_found";
        case delivery::resource_error: return "resource_error";
        case delivery::payload_too_large: return "payload_too_large";
    }
    return "unknown";
}

std::string_view name_of(at_status code) noexcept {
    switch (code) {
        case at_status::ok: return "ok";
        case at_status::error: return "error";
        case at_status::bad_command: return "bad_command";
        case at_status::bad_parameter: return "bad_parameter";
        case at_status::tx_failure: return "tx_failure";
    }
    return "unknown";
}

std::uint8_t type_of(const frame& f) noexcept {
    static constexpr std::array<std::uint8_t, 8> types{0x08, 0x88, 0x10, 0x8B, 0x90, 0x17, 0x97, 0x8A};
    if (auto* raw = std::get_if<raw_frame>(&f)) return raw->type;
    if (auto* request = std::get_if<at_request>(&f)) return request->queued ? 0x09 : 0x08;
    return types[f.index()];
}

parsed_frame parse_frame_data(ise::bytes_view data) {
    if (data.empty()) return refused{refusal::bad_length, "a frame without a type byte"};
    std::uint8_t type = u8(data[0]);
    std::size_t needed = fixed_size(type);
    if (data.size() < needed)
        return refused{refusal::too_short_for_type,
                       fmt::format("frame type {:02X} needs {} bytes, has {}", type, needed, data.size())};
    field_reader in(data.subspan(1));
    switch (type) {
        case 0x08:
        case 0x09: {
            at_request f;
            f.frame_id = in.take<std::uint8_t>();
            f.command = in.name();
            f.parameter = in.rest();
            f.queued = type == 0x09;
            return frame(std::move(f));
        }
        case 0x88: {
            at_response f;
            f.frame_id = in.take<std::uint8_t>();
            f.command = in.name();
            f.status = static_cast<at_status>(in.take<std::uint8_t>());
            f.value = in.rest();
            return frame(std::move(f));
        }
        case 0x10: {
            transmit_request f;
            f.frame_id = in.take<std::uint8_t>();
            f.destination = in.take<std::uint64_t>();
            f.network = in.take<std::uint16_t>();
            f.radius = in.take<std::uint8_t>();
            f.options = in.take<std::uint8_t>();
            f.payload = in.rest();
            return frame(std::move(f));
        }
        case 0x8B: {
            transmit_status f;
            f.frame_id = in.take<std::uint8_t>();
            f.network = in.take<std::uint16_t>();
            f.retries = in.take<std::uint8_t>();
            f.outcome = static_cast<delivery>(in.take<std::uint8_t>());
            f.discovery = in.take<std::uint8_t>();
            return frame(f);
        }
        case 0x90: {
            received_packet f;
            f.source = in.take<std::uint64_t>();
            f.network = in.take<std::uint16_t>();
            f.options = in.take<std::uint8_t>();
            f.payload = in.rest();
            return frame(std::move(f));
        }
        case 0x17: {
            remote_at_request f;
            f.frame_id = in.take<std::uint8_t>();
            f.destination = in.take<std::uint64_t>();
            f.network = in.take<std::uint16_t>();
            f.options = in.take<std::uint8_t>();
            f.command = in.name();
            f.parameter = in.rest();
            return frame(std::move(f));
        }
        case 0x97: {
            remote_at_response f;
            f.frame_id = in.take<std::uint8_t>();
            f.source = in.take<std::uint64_t>();
            f.network = in.take<std::uint16_t>();
            f.command = in.name();
            f.status = static_cast<at_status>(in.take<std::uint8_t>());
            f.value = in.rest();
            return frame(std::move(f));
        }
        case 0x8A: return frame(modem_status{in.take<std::uint8_t>()});
        default: return frame(raw_frame{type, in.rest()});
    }
}

parsed_frame parse_frame(ise::bytes_view wire, api_mode mode) {
    frame_scan scan = scan_frame(wire, mode);
    if (scan.state == scan_state::refused) return refused{scan.reason, std::move(scan.message)};
    if (scan.state == scan_state::incomplete)
        return refused{refusal::truncated,
                       fmt::format("the frame ends after {} bytes, before its checksum", wire.size())};
    if (scan.wire_size != wire.size())
        return refused{refusal::trailing_bytes, fmt::format("{} bytes follow the frame", wire.size() - scan.wire_size)};
    return parse_frame_data(scan.data);
}

ise::bytes frame_data(const frame& f) { return std::visit(encoder{}, f); }

ise::bytes encode(const frame& f, api_mode mode) {
    ise::bytes data = frame_data(f);
    if (data.size() > max_frame_data)
        throw ise::error(ise::errc::too_large,
                         fmt::format("an XBee frame of {} bytes; the limit is {}", data.size(), max_frame_data));
    ise::bytes out;
    out.reserve(data.size() + 4);
    out.push_back(std::byte{0x7E});
    auto put = [&](std::uint8_t b) {
        if (mode == api_mode::escaped && is_special(b)) {
            out.push_back(std::byte{0x7D});
            b ^= 0x20;
        }
        out.push_back(std::byte{b});
    };
    put(static_cast<std::uint8_t>(data.size() >> 8));
    put(static_cast<std::uint8_t>(data.size() & 0xFF));
    std::uint8_t sum = 0;
    for (std::byte b : data) {
        sum = static_cast<std::uint8_t>(sum + u8(b));
        put(u8(b));
    }
    put(static_cast<std::uint8_t>(0xFF - sum));
    return out;
}

} // namespace atirma::xbee
