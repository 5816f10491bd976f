#include <components/gui_client/console_state.hpp>

#include <components/boat/parameters.hpp>
#include <components/gui_client/words.hpp>

#include <fmt/format.h>

#include <algorithm>

namespace atirma::console {
namespace {
constexpr std::size_t credit_bytes = 50;
constexpr auto just_now = std::chrono::seconds(10);
std::uint64_t credits(std::size_t bytes) { return (bytes + credit_bytes - 1) / credit_bytes; }

} // namespace

console_state::console_state(state_options options)
    : options_(options), track_(options.max_track), commands_(options.max_commands) {
    for (const auto& info : parameters()) {
        parameter_view one;
        one.id = info.id;
        parameters_.push_back(one);
    }
    present_ = std::make_shared<const std::vector<present_component>>();
}

void console_state::on_telemetry(const std::string& path, const telemetry_packet& packet, utc_time now) {
    auto* link = link_at(path);
    if (!link) return;
    auto message = parse_telemetry(packet.raw);
    bool first = message && seen_.first_time(packet.boot, packet.sequence, packet.raw);
    if (link->all_links) { // its record goes back for hours, and what is new comes from the proxies as well
        if (!first) return;
        auto came = std::min(now, packet.received_at);
        boat_.last_heard = std::max(came, boat_.last_heard.value_or(utc_time()));
        link->last_heard = boat_.last_heard;
        link->link = packet.link;
        ++link->packets;
        for (auto& [at, proxy] : links_) // it came over one of them, also before this console looked
            if (!proxy.all_links && proxy.link == packet.link)
                proxy.last_heard = std::max(came, proxy.last_heard.value_or(utc_time()));
    }
    auto raw = std::make_shared<raw_packet>();
    raw->number = ++packet_count_;
    raw->path = path;
    raw->arrived_at = now;
    raw->duplicate = message && !first;
    raw->packet = packet;
    packets_.push_back(std::move(raw));
    if (packets_.size() > options_.max_packets) packets_.pop_front();
    shared_packets_.reset();
    if (!message) {
        ++link->malformed;
        return;
    }
    // The last packet comes again with each new subscription: that is no sign of life.
    if (!link->all_links && heard_over_[path].first_time(packet.boot, packet.sequence, packet.raw)) {
        ++link->packets;
        link->link = packet.link;
        link->bytes += packet.raw.size();
        if (packet.link == link_id::iridium) link->credits += credits(packet.raw.size());
        auto at = std::min(now, std::max(packet.received_at, link->last_heard.value_or(utc_time())));
        link->last_heard = at;
        boat_.last_heard = std::max(at, boat_.last_heard.value_or(utc_time()));
        if (!first) ++link->duplicates;
    }
    // Of the nodes' record it counts when it came to the shore, not when this console asked for it.
    bool kept = link->all_links && now - packet.received_at > just_now;
    if (first) take(*message, packet, kept ? packet.received_at : now);
}

void console_state::take(const telemetry_message& message, const telemetry_packet& packet, utc_time now) {
    const auto& body = message.body;
    if (!packet.history) rebooted(packet, now);
    if (const auto* l = std::get_if<location>(&body)) {
        take_location(*l, packet, now);
    } else if (const auto* n = std::get_if<navigation>(&body)) {
        take_newer(boat_.sailing, *n, packet, now);
    } else if (const auto* w = std::get_if<wind>(&body)) {
        take_newer(boat_.breeze, *w, packet, now);
    } else if (const auto* p = std::get_if<power>(&body)) {
        take_newer(boat_.supply, *p, packet, now);
    } else if (const auto* part = std::get_if<waypoints>(&body)) {
        if (!packet.history) mission_.take(packet.boot, *part, now);
    } else if (const auto* c = std::get_if<configuration>(&body)) {
        if (take_newer(boat_.settings, *c, packet, now)) take_settings(*c, now);
    } else if (const auto* s = std::get_if<link_status>(&body)) {
        auto place = static_cast<std::size_t>(s->link);
        if (place < link_count) take_newer(boat_.links[place], *s, packet, now);
    } else if (const auto* text = std::get_if<notice>(&body)) {
        boat_.notices.push_back(heard<notice>{*text, packet.measured_at, now, packet.link, packet.boot});
        if (boat_.notices.size() > options_.max_notices) boat_.notices.erase(boat_.notices.begin());
    }
}

void console_state::take_location(const location& told, const telemetry_packet& packet, utc_time now) {
    bool fix = has_fix(told);
    bool newest = !packet.history && (!boat_.position || plausible_time(packet) >= boat_.position->measured_at);
    if (newest) boat_.has_fix = fix;
    if (!fix) return;
    take_newer(boat_.position, told, packet, now);
    track_point point;
    point.at = plausible_time(packet);
    point.latitude_deg = told.latitude_deg;
    point.longitude_deg = told.longitude_deg;
    point.speed_mps = told.speed_over_ground_mps;
    point.link = packet.link;
    point.history = packet.history;
    point.boot = packet.boot;
    track_.add(point);
}

void console_state::take_settings(const configuration& told, utc_time now) {
    for (auto& one : parameters_) {
        std::optional<float> value;
        switch (one.id) {
            case parameter_id::time_to_next_tack: value = told.time_to_next_tack_s; break;
            case parameter_id::forbidden_angle_upwind: value = told.forbidden_angle_upwind_deg; break;
            case parameter_id::forbidden_angle_downwind: value = told.forbidden_angle_downwind_deg; break;
            case parameter_id::telemetry_period:
                value = told.telemetry_period_s[static_cast<std::size_t>(link_id::xbee)];
                break;
            case parameter_id::leeway_compensation: value = told.leeway_compensation; break;
        }
        if (!value) continue;
        one.confirmed = value;
        one.confirmed_at = now;
    }
}

void console_state::rebooted(const telemetry_packet& packet, utc_time now) {
    if (boot_ == packet.boot || packet.measured_at < boot_measured_) return;
    if (boot_ && now != packet.received_at) // else it is what the record tells of long ago
        alarms_.tell("boot", severity::warning,
                     fmt::format("The boat has started again (boot {}, before {})", packet.boot, *boot_), now);
    boot_ = packet.boot;
    boot_measured_ = packet.measured_at;
}

void console_state::on_present(std::vector<present_component> all) {
    present_ = std::make_shared<const std::vector<present_component>>(std::move(all));
}

void console_state::on_time(utc_time now) {
    watch_boat(now);
    watch_links(now);
    watch_nodes(now);
}

std::shared_ptr<const snapshot> console_state::view(utc_time now) {
    auto made = std::make_shared<snapshot>();
    made->number = ++snapshot_count_;
    made->at = now;
    made->finding = finding_;
    made->boat = boat_;
    made->mission = mission_.view();
    made->upload = upload_;
    made->authority = authority_;
    made->limits = options_.limits;
    for (const auto& [path, node] : nodes_) made->nodes.push_back(node);
    made->parameters = parameters_;
    for (const auto& [path, link] : links_) {
        made->links.push_back(link);
        made->links.back().open_commands = commands_.open(path);
    }
    made->alarms = alarms_.list();
    made->track = track_.points();
    made->track_bytes = track_.bytes();
    made->commands = commands_.entries();
    if (!shared_packets_)
        shared_packets_ =
            std::make_shared<const std::vector<std::shared_ptr<const raw_packet>>>(packets_.begin(), packets_.end());
    made->packets = shared_packets_;
    made->present = present_;
    return made;
}

} // namespace atirma::console
