#include <components/boat/decoded_telemetry.hpp>

#include <components/boat/services.hpp>
#include <components/boat/telemetry.hpp>

#include <ise/packet/json.hpp>

#include <fmt/format.h>

#include <variant>

namespace atirma {
namespace {

// What `ise echo --losses` puts around a packet.
constexpr std::string_view envelope = "{\"lost_before\":";
constexpr std::string_view packet_in_envelope = ",\"packet\":";

} // namespace

ise::result<std::string> decoded_telemetry(std::string_view line) {
    std::string_view before, after;
    if (line.starts_with(envelope)) {
        auto begin = line.find(packet_in_envelope);
        if (begin == line.npos || !line.ends_with('}'))
            return ise::failure(ise::errc::malformed, "no line of `ise echo --losses`");
        begin += packet_in_envelope.size();
        before = line.substr(0, begin);
        after = "}";
        line = line.substr(begin, line.size() - begin - 1);
    }
    try {
        auto packet = ise::from_json<telemetry_packet>(line);
        auto message = parse_telemetry(packet.raw);
        if (!message) return message.error();
        packet.raw.clear();
        constexpr std::string_view bytes = "\"raw\":\"\"";
        auto text = ise::to_json(packet);
        auto report = std::visit([](const auto& body) { return ise::to_json(body); }, message->body);
        text.replace(text.find(bytes), bytes.size(),
                     fmt::format("\"kind\":\"{}\",\"report\":{}", name_of(message->body), report));
        return fmt::format("{}{}{}", before, text, after);
    } catch (const ise::error& why) {
        return why.why();
    }
}

} // namespace atirma
