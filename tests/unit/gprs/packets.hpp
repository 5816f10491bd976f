#pragma once
#include <components/boat/telecommand.hpp>
#include <components/gprs/line.hpp>

namespace gprs_test {

/// A fix, as the boat sends it.
inline ise::bytes fix(std::uint32_t sequence, std::uint16_t boot = 5) {
    atirma::packet_header header;
    header.boot = boot;
    header.sequence = sequence;
    header.measured_at = atirma::utc_time(std::chrono::seconds(1'500'000'000 + sequence));
    atirma::location where;
    where.latitude_deg = 28.15;
    where.longitude_deg = -15.45;
    where.quality = atirma::fix_quality::gps;
    return atirma::encode_telemetry(header, where);
}

/// Something else that it measures.
inline ise::bytes breeze(std::uint32_t sequence, std::uint16_t boot = 5) {
    atirma::packet_header header;
    header.boot = boot;
    header.sequence = sequence;
    header.measured_at = atirma::utc_time(std::chrono::seconds(1'500'000'000 + sequence));
    return atirma::encode_telemetry(header, atirma::wind{});
}

inline ise::bytes ack_of(std::uint32_t id) {
    atirma::acknowledgement ack;
    ack.header.boot = 5;
    ack.id = id;
    ack.kind = atirma::command_kind::set_mode;
    ack.text = "hold";
    return atirma::encode_acknowledgement(ack);
}

inline std::uint32_t sequence_of(ise::bytes_view raw) { return atirma::parse_telemetry(raw).value().header.sequence; }

/// The lines of a text.
inline std::vector<atirma::gprs::line> lines_of(std::string_view text) {
    std::vector<atirma::gprs::line> all;
    while (!text.empty()) {
        auto end = text.find("\r\n");
        all.push_back(atirma::gprs::parse(text.substr(0, end)).value());
        text.remove_prefix(end + 2);
    }
    return all;
}

} // namespace gprs_test
