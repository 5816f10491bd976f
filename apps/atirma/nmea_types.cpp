#include "nmea_types.hpp"

#include <components/boat/services.hpp>
#include <components/nmea_bridge/nmea_bridge.hpp>
#include <components/nmea_bridge/services.hpp>
#include <components/nmea_bridge/signalk.hpp>

#include <fmt/format.h>

namespace atirma {
namespace {

struct outlet_words {
    std::string tcp;
    std::vector<std::string> udp;
};

ise::endpoint read(const std::string& text, ise::protocol kind) {
    auto parsed = ise::endpoint::parse(text).value();
    if (parsed.kind != kind)
        throw ise::error(
            ise::errc::invalid_argument,
            fmt::format("'{}' is not a {} endpoint such as {}://127.0.0.1:10110", text, name_of(kind), name_of(kind)));
    return parsed;
}

void fill(outlet_options& into, const outlet_words& words) {
    into.tcp.reset();
    into.udp.clear();
    if (!words.tcp.empty()) into.tcp = read(words.tcp, ise::protocol::tcp);
    for (const auto& one : words.udp) into.udp.push_back(read(one, ise::protocol::udp));
}

} // namespace

ise::component_type nmea_bridge_type(std::function<void(const std::string&)> announce) {
    ise::component_type type("nmea-bridge", "the boat for gpsd, OpenCPN and Signal K", "atirma/nmea");
    auto options = std::make_shared<nmea_bridge_options>();
    auto nmea = std::make_shared<outlet_words>(), signalk = std::make_shared<outlet_words>();
    options->telemetry = {"atirma/shore/xbee"};
    options->on_listening = [announce](const std::string& where) { announce("ready: " + where); };
    nmea->tcp = "tcp://127.0.0.1:10110";
    auto& set = type.parameters;
    set.add("telemetry", options->telemetry, "paths of the proxies to subscribe to");
    set.add("nmea-tcp", nmea->tcp, "endpoint for NMEA 0183 clients; empty: none").kind(ise::parameter_kind::endpoint);
    set.add("nmea-udp", nmea->udp, "destinations of NMEA 0183: udp://127.0.0.1:10110").kind(ise::parameter_kind::url);
    set.add("signalk-tcp", signalk->tcp, "endpoint for Signal K clients; empty: none")
        .kind(ise::parameter_kind::endpoint);
    set.add("signalk-udp", signalk->udp, "destinations of Signal K deltas").kind(ise::parameter_kind::url);
    set.add("vessel-name", options->vessel, "name of the boat, for Signal K");
    set.add("vessel-uuid", options->vessel_uuid,
            "UUID (version 4) of the boat, for Signal K; empty: derived from its name");
    type.requires_(services::telemetry).provides(services::bridge);
    type.make = [options, nmea, signalk] {
        fill(options->nmea, *nmea);
        fill(options->signalk, *signalk);
        if (!options->vessel_uuid.empty() && !signalk::is_uuid(options->vessel_uuid))
            throw ise::error(ise::errc::invalid_argument,
                             fmt::format("vessel-uuid: {} is not a UUID of version 4 in lower case, such as "
                                         "705f5f1a-efaf-44aa-9cb8-a0fd6305567c",
                                         options->vessel_uuid));
        return std::make_unique<nmea_bridge>(*options);
    };
    return type;
}

} // namespace atirma
