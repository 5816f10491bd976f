#include <components/boat/newest_reports.hpp>

namespace atirma {

std::optional<std::size_t> newest_reports::take(const telemetry_packet& packet) {
    auto message = parse_telemetry(packet.raw);
    if (!message) {
        ++malformed_;
        return std::nullopt;
    }
    if (!seen_.first_time(packet.boot, packet.sequence, packet.raw)) return std::nullopt;
    const auto& body = message->body;
    bool newer = false;
    if (const auto* l = std::get_if<atirma::location>(&body))
        newer = has_fix(*l) && take_newer(location_, *l, packet, packet.received_at);
    else if (const auto* n = std::get_if<atirma::navigation>(&body))
        newer = take_newer(navigation_, *n, packet, packet.received_at);
    else if (const auto* w = std::get_if<atirma::wind>(&body))
        newer = take_newer(wind_, *w, packet, packet.received_at);
    else if (const auto* p = std::get_if<atirma::power>(&body))
        newer = take_newer(power_, *p, packet, packet.received_at);
    else if (const auto* s = std::get_if<link_status>(&body))
        newer = take_newer(links_[static_cast<std::size_t>(s->link)], *s, packet, packet.received_at);
    if (!newer) return std::nullopt;
    return body.index();
}

} // namespace atirma
