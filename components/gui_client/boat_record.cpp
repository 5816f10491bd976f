#include <components/gui_client/boat_record.hpp>

#include <algorithm>
#include <utility>

namespace atirma::console {
bool boat_record::on_message(const telemetry_message& message, const telemetry_packet& packet, utc_time now) {
    const auto& body = message.body;
    if (const auto* l = std::get_if<location>(&body)) return take(*l, packet, now);
    if (const auto* n = std::get_if<navigation>(&body)) return take(*n, packet, now);
    if (const auto* w = std::get_if<wind>(&body)) return take_newer(view_.breeze, *w, packet, now);
    if (const auto* p = std::get_if<power>(&body)) return take_newer(view_.supply, *p, packet, now);
    if (const auto* c = std::get_if<configuration>(&body)) {
        bool newer = take_newer(view_.settings, *c, packet, now);
        if (newer) view_.rhythm.on_configuration(*c);
        return newer;
    }
    if (const auto* s = std::get_if<link_status>(&body)) return take(*s, packet, now);
    if (const auto* text = std::get_if<notice>(&body)) return take(*text, packet, now);
    return false;
}

bool boat_record::take(const navigation& result, const telemetry_packet& packet, utc_time now) {
    auto before = view_.sailing;
    if (!take_newer(view_.sailing, result, packet, now)) return false;
    auto measured = view_.sailing->measured_at;
    if (!before || before->value.mode != result.mode) mode_first_ = measured;
    if (before && before->value.mode != result.mode) other_last_ = before->measured_at;
    if (result.remote_control || (before && before->value.remote_control)) remote_ = measured;
    count_mode();
    return true;
}

void boat_record::on_mode_set(utc_time executed_at) {
    mode_set_ = std::max(mode_set_, executed_at);
    count_mode();
}

/// The boat counts the time of Heading and Manual from the order, also one that renews it, and from the end of remote
/// control.
void boat_record::count_mode() {
    if (!view_.sailing) return;
    bool ordered = mode_set_ != utc_time() && mode_set_ >= other_last_; // else the boat changed it by itself
    view_.mode_since = std::max(ordered ? mode_set_ : mode_first_, remote_);
}

bool boat_record::take(const location& result, const telemetry_packet& packet, utc_time now) {
    bool fix = has_fix(result);
    bool newest = !packet.history && (!view_.position || plausible_time(packet) >= view_.position->measured_at);
    if (newest) view_.has_fix = fix;
    if (!packet.history && packet.boot != beacon_boot) view_.rhythm.on_report(packet.link, plausible_time(packet));
    return fix && take_newer(view_.position, result, packet, now);
}

bool boat_record::take(const link_status& result, const telemetry_packet& packet, utc_time now) {
    auto place = static_cast<std::size_t>(result.link);
    return place < link_count && take_newer(view_.links[place], result, packet, now);
}

bool boat_record::take(const notice& result, const telemetry_packet& packet, utc_time now) {
    if (packet.boot == beacon_boot) take_newer(view_.beacon, result, packet, now);
    view_.notices.push_back(heard<notice>{result, packet.measured_at, now, packet.link, packet.boot});
    if (view_.notices.size() > max_notices_) view_.notices.erase(view_.notices.begin());
    return true;
}

std::optional<std::uint16_t> boat_record::on_boot(const telemetry_packet& packet) {
    auto measured = plausible_time(packet); // one from the future would hide all later starts
    if (packet.history || packet.boot == beacon_boot || boot_ == packet.boot || measured < boot_measured_)
        return std::nullopt;
    boot_measured_ = measured;
    return std::exchange(boot_, packet.boot);
}

void boat_record::on_heard(utc_time at) { view_.last_heard = std::max(at, view_.last_heard.value_or(utc_time())); }

} // namespace atirma::console
