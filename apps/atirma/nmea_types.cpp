#include "nmea_types.hpp"

#include <components/boat/services.hpp>
#include <components/nmea_bridge/nmea_bridge.hpp>
#include <components/nmea_bridge/services.hpp>

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
        throw ise::error(ise::errc::invalid_argument,
                         fmt::format("{} is no {} endpoint: {}://127.0.0.1:10110", text, name_of(kind), name_of(kind)));
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
    set.add("telemetry", options->telemetry, "paths of the proxies to listen to");
    set.add("nmea-tcp", nmea->tcp, "where NMEA 0183 is served; empty: nowhere");
    set.add("nmea-udp", nmea->udp, "whom NMEA 0183 is sent to: udp://127.0.0.1:10110");
    set.add("signalk-tcp", signalk->tcp, "where Signal K deltas are served; empty: nowhere");
    set.add("signalk-udp", signalk->udp, "whom Signal K deltas are sent to");
    type.requires_(services::telemetry).provides(services::bridge);
    type.make = [options, nmea, signalk] {
        fill(options->nmea, *nmea);
        fill(options->signalk, *signalk);
        return std::make_unique<nmea_bridge>(*options);
    };
    return type;
}

} // namespace atirma
