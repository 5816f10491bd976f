#pragma once
#include <components/gui_client/console_state.hpp>

#include <string>

namespace console_test {

using namespace std::chrono_literals;
using namespace atirma;
using namespace atirma::console;

inline const utc_time t0{std::chrono::milliseconds(1'790'000'000'000)};
inline const std::string xbee_path = "atirma/shore/xbee", gprs_path = "atirma/shore/gprs",
                         iridium_path = "atirma/shore/iridium";

/// What a boat tells: each packet gets the next sequence number.
struct talker {
    std::uint16_t boot = 7;
    std::uint32_t sequence = 0;

    telemetry_packet say(const telemetry_body& body, utc_time measured, link_id link = link_id::xbee) {
        packet_header header{boot, ++sequence, measured};
        telemetry_packet made;
        made.link = link;
        made.boot = boot;
        made.sequence = header.sequence;
        made.measured_at = measured;
        made.received_at = measured + 1s;
        made.raw = encode_telemetry(header, body);
        return made;
    }
};

inline location at(double latitude, double longitude) {
    location made;
    made.latitude_deg = latitude;
    made.longitude_deg = longitude;
    made.quality = fix_quality::gps;
    made.satellites = 9;
    made.speed_over_ground_mps = 1.2f;
    return made;
}

inline telecommand_status status(std::uint32_t id, telecommand_stage stage,
                                 std::optional<ack_code> result = std::nullopt, std::string text = "") {
    telecommand_status made;
    made.id = id;
    made.kind = command_kind::set_mode;
    made.state = stage;
    made.result = result;
    made.text = std::move(text);
    return made;
}

inline const alarm_entry* find(const std::vector<alarm_entry>& all, const std::string& key) {
    for (const auto& one : all)
        if (one.key == key) return &one;
    return nullptr;
}

} // namespace console_test
