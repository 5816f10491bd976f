#include <components/gui_client/console_state.hpp>

#include <components/gui_client/alarm_rules.hpp>
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
    : options_(options), boat_(options.max_notices), course_(options.sea), track_(options.max_track),
      commands_(options.max_commands), packets_(options.max_packets) {
    present_ = std::make_shared<const std::vector<present_component>>();
}

void console_state::on_telemetry(const std::string& path, const telemetry_packet& packet, utc_time now) {
    auto* link = link_at(path);
    if (!link) return;
    auto message = parse_telemetry(packet.raw);
    bool first = message && seen_.first_time(packet.boot, packet.sequence, packet.raw);
    if (link->all_links) { // its record covers hours, and new packets come from the proxies as well
        if (!first) return;
        count_recorded(*link, packet, now);
    }
    packets_.add(path, packet, message && !first, now);
    if (!message) {
        ++link->malformed;
        return;
    }
    if (!link->all_links) count(*link, packet, first, now);
    // A packet of the nodes' record counts from when it came to the shore, not from when this console asked for it.
    bool kept = link->all_links && now - packet.received_at > just_now;
    if (first) take(*message, packet, kept ? packet.received_at : now, kept);
}

void console_state::count_recorded(link_view& role, const telemetry_packet& packet, utc_time now) {
    auto came = std::min(now, packet.received_at);
    boat_.on_heard(came);
    role.last_heard = boat_.view().last_heard;
    role.link = packet.link;
    ++role.packets;
    for (auto& [at, proxy] : links_) // it came over one of them, possibly before this console started
        if (!proxy.all_links && proxy.link == packet.link)
            proxy.last_heard = std::max(came, proxy.last_heard.value_or(utc_time()));
}

void console_state::count(link_view& link, const telemetry_packet& packet, bool first, utc_time now) {
    // Each new subscription repeats the last packet: that is no sign of life.
    if (!heard_over_[link.path].first_time(packet.boot, packet.sequence, packet.raw)) return;
    ++link.packets;
    link.link = packet.link;
    link.bytes += packet.raw.size();
    if (packet.link == link_id::iridium) link.credits += credits(packet.raw.size());
    link.last_heard = std::min(now, std::max(packet.received_at, link.last_heard.value_or(utc_time())));
    boat_.on_heard(*link.last_heard);
    if (!first) ++link.duplicates;
}

void console_state::take(const telemetry_message& message, const telemetry_packet& packet, utc_time now, bool kept) {
    auto boot_before = boat_.on_boot(packet);
    if (boot_before && !kept)
        alarms_.tell("boot", severity::warning,
                     fmt::format("The boat has started again (boot {}, before {})", packet.boot, *boot_before), now);
    bool newest = boat_.on_message(message, packet, now);
    if (const auto* l = std::get_if<location>(&message.body); l && has_fix(*l)) {
        track_point point;
        point.at = plausible_time(packet);
        point.latitude_deg = l->latitude_deg;
        point.longitude_deg = l->longitude_deg;
        point.speed_mps = l->speed_over_ground_mps;
        point.link = packet.link;
        point.history = packet.history;
        point.boot = packet.boot;
        track_.add(point);
    } else if (const auto* part = std::get_if<waypoints>(&message.body)) {
        if (!packet.history) mission_.take(packet.boot, *part, plausible_time(packet), now);
    } else if (const auto* c = std::get_if<configuration>(&message.body)) {
        if (newest) parameters_.on_settings(*c, now);
    }
}

void console_state::on_status(const std::string& path, const telecommand_status& status, utc_time now) {
    auto* link = link_at(path);
    if (!link) return;
    if (!link->link && !link->all_links) link->link = status.link;
    const auto* before = commands_.find(status.id);
    auto attempts = before ? before->attempts : 0;
    const auto& entry = commands_.on_status(path, status, now);
    if (!link->all_links && status.link == link_id::iridium && entry.attempts > attempts)
        link->credits += entry.attempts - attempts; // a telecommand is shorter than a credit's bytes
    if (status.kind == command_kind::set_mode && entry.phase == command_phase::done && entry.executed_at)
        on_mode_set(std::min(now, *entry.executed_at));
    if (is_over(entry.phase)) parameters_.on_settled(entry.id, entry.phase, entry.value, entry.text, now);
}

void console_state::asked(std::uint32_t id, const std::string& path, const boat_command& command, utc_time now,
                          std::optional<utc_time> valid_until) {
    command_entry entry;
    entry.id = id;
    entry.path = path;
    entry.link = link_of_path(path);
    entry.what = describe(command);
    entry.own = true;
    entry.asked_at = now;
    entry.valid_until = valid_until;
    commands_.asked(std::move(entry));
    parameters_.on_asked(id, command);
}

void console_state::on_outcome(std::uint32_t id, command_phase phase, std::optional<float> value, std::string text,
                               utc_time now) {
    commands_.on_outcome(id, phase, value, text, now);
    if (!is_over(phase)) return;
    parameters_.on_settled(id, phase, value, text, now);
    if (phase == command_phase::done) return;
    const auto* entry = commands_.find(id);
    auto what = entry ? entry->what : fmt::format("telecommand {}", id);
    alarms_.tell(fmt::format("command:{}", id), severity::warning,
                 fmt::format("“{}” {}: {}", what, name_of(phase), text), now);
}

void console_state::on_present(std::vector<present_component> all) {
    present_ = std::make_shared<const std::vector<present_component>>(std::move(all));
}

bool console_state::on_time(utc_time now) {
    apply_alarm_rules(alarms_, alarm_causes{options_.limits, finding_, boat_.view(), links_, nodes_}, now);
    course_.apply(alarms_, boat_.view(), mission_.view(), now);
    watch_authority(now);
    watch_requests(now);
    auto alarms = alarms_.list();
    const auto* calls = bell_.update(alarms, now);
    if (!calls) return false;
    ++last_call_.count;
    last_call_.how = calls->how;
    last_call_.text = calls->text;
    return true;
}

std::vector<alarm_event> console_state::take_alarm_events() {
    std::vector<alarm_event> fresh;
    if (events_taken_ == alarms_.last_event()) return fresh;
    auto log = alarms_.log();
    for (const auto& one : *log)
        if (one.number > events_taken_) fresh.push_back(one);
    events_taken_ = alarms_.last_event();
    return fresh;
}

std::shared_ptr<const snapshot> console_state::view(utc_time now) {
    auto made = std::make_shared<snapshot>();
    made->number = ++snapshot_count_;
    made->at = now;
    made->finding = finding_;
    made->boat = boat_.view();
    made->mission = mission_.view();
    made->upload = upload_;
    made->authority = authority_;
    std::erase_if(made->authority.state.asked_by, [this](const auto& who) { return has_gone(who); });
    made->bell = last_call_;
    made->sea = options_.sea;
    made->alarm_log = alarms_.log();
    made->limits = options_.limits;
    for (const auto& [path, node] : nodes_) made->nodes.push_back(node);
    made->parameters = parameters_.view();
    for (const auto& [path, link] : links_) {
        made->links.push_back(link);
        made->links.back().open_commands = commands_.open(path);
    }
    made->alarms = alarms_.list();
    made->track = track_.points();
    made->track_bytes = track_.bytes();
    made->commands = commands_.entries();
    made->packets = packets_.packets();
    made->present = present_;
    return made;
}

} // namespace atirma::console
