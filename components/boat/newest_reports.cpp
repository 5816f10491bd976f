#include <components/boat/newest_reports.hpp>

namespace atirma {
namespace {

template <class P>
bool replace(std::optional<dated<P>>& known, const P& by, const telemetry_packet& packet) {
    auto measured = plausible_time(packet);
    if (known && measured <= known->measured_at) return false;
    known = dated<P>{by, measured, packet.received_at, packet.link};
    return true;
}

} // namespace

std::optional<std::size_t> newest_reports::take(const telemetry_packet& packet) {
    auto message = parse_telemetry(packet.raw);
    if (!message) {
        ++malformed_;
        return std::nullopt;
    }
    if (!seen_.first_time(packet.boot, packet.sequence, packet.raw) || packet.history) return std::nullopt;
    const auto& body = message->body;
    bool newer = false;
    if (const auto* l = std::get_if<atirma::location>(&body)) newer = has_fix(*l) && replace(location_, *l, packet);
    else if (const auto* n = std::get_if<atirma::navigation>(&body)) newer = replace(navigation_, *n, packet);
    else if (const auto* w = std::get_if<atirma::wind>(&body)) newer = replace(wind_, *w, packet);
    else if (const auto* p = std::get_if<atirma::power>(&body)) newer = replace(power_, *p, packet);
    else if (const auto* s = std::get_if<link_status>(&body))
        newer = replace(links_[static_cast<std::size_t>(s->link)], *s, packet);
    if (!newer) return std::nullopt;
    return body.index();
}

} // namespace atirma
