#include "account.hpp"

#include <components/xbee_link/xbee_link_emulator.hpp>

namespace atirma::stress {

waypoint short_range_node() { return xbee_link_options().shore_position; }

console_view view_of(const std::string& name, const console::operator_port& at) {
    auto shown = at.latest();
    console_view made;
    made.name = name;
    made.fix = shown->boat.position.has_value();
    made.links = shown->links.size();
    if (shown->track) made.track = shown->track->size();
    if (shown->commands) made.commands = shown->commands->size();
    if (shown->present) made.present = shown->present->size();
    return made;
}

std::vector<executed_command> late_executions(const account& of) {
    // The model of the boat moves in steps of 0.1 s, and its console's component in ticks.
    constexpr ise::duration step = std::chrono::milliseconds(500);
    std::vector<executed_command> late;
    for (const auto& one : of.executed)
        for (const auto& who : of.people)
            for (const auto& given : who.commands)
                if (given.request.id == one.id && one.at > given.valid_until + step) late.push_back(one);
    return late;
}

std::set<packet_key> keys_on(ise::database& disk) {
    auto rows = disk.query("SELECT boot, sequence FROM packets");
    std::set<packet_key> made;
    for (const auto& row : rows.value())
        made.insert(key_of(static_cast<std::uint16_t>(row.integer(0)), static_cast<std::uint32_t>(row.integer(1))));
    return made;
}

std::set<packet_key> keys_at_boat(ise::database& memory) {
    std::set<packet_key> made;
    for (const auto* sql : {"SELECT raw FROM not_receipted", "SELECT raw FROM unacknowledged"}) {
        auto rows = memory.query(sql);
        for (const auto& row : rows.value())
            if (auto which = telemetry_key(row.bytes(0))) made.insert(*which);
    }
    return made;
}

std::set<std::uint32_t> commands_on(ise::database& disk) {
    auto rows = disk.query("SELECT id FROM commands");
    std::set<std::uint32_t> made;
    for (const auto& row : rows.value()) made.insert(static_cast<std::uint32_t>(row.integer(0)));
    return made;
}

std::vector<telemetry_packet> packets_on(ise::database& disk) {
    auto rows = disk.query(
        "SELECT boot, sequence, measured, link, received, history, raw FROM packets ORDER BY measured, boot, sequence");
    std::vector<telemetry_packet> made;
    for (const auto& row : rows.value()) {
        auto& one = made.emplace_back();
        one.boot = static_cast<std::uint16_t>(row.integer(0));
        one.sequence = static_cast<std::uint32_t>(row.integer(1));
        one.measured_at = utc_time(std::chrono::milliseconds(row.integer(2)));
        one.link = static_cast<link_id>(row.integer(3));
        one.received_at = utc_time(std::chrono::milliseconds(row.integer(4)));
        one.history = row.integer(5) != 0;
        one.raw = row.bytes(6);
    }
    return made;
}

} // namespace atirma::stress
