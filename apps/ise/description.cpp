#include "description.hpp"

#include "table.hpp"
#include "text.hpp"
#include "waits.hpp"

#include <ise/component/discover.hpp>
#include <ise/packet/json.hpp>

#include <nlohmann/json.hpp>

#include <fmt/format.h>

namespace ise::cli {
namespace {

using nlohmann::ordered_json;

std::string hex(std::uint64_t number) { return fmt::format("{:016x}", number); }

service_kind kind_of(const service_text& one) {
    return one.kind == 0 ? service_kind::request_response : service_kind::subscription;
}

ordered_json service_json(const service_text& one) {
    ordered_json told;
    told["name"] = one.name;
    told["kind"] = ise::name_of(kind_of(one));
    told["provided"] = one.provided;
    auto packets = ordered_json::array();
    for (std::size_t place = 0; place < one.packets.size(); ++place) {
        ordered_json packet;
        packet["role"] = role::name(kind_of(one), place);
        packet["fingerprint"] = hex(one.packets[place].fingerprint);
        packet["schema"] = one.packets[place].schema;
        packets.push_back(std::move(packet));
    }
    told["packets"] = std::move(packets);
    told["declared"] = one.declared;
    return told;
}

// Fit for a shell, between single quotes.
std::string shell_quoted(const std::string& text) {
    std::string out = "'";
    for (char letter : text) out += letter == '\'' ? std::string("'\\''") : std::string(1, letter);
    return out + "'";
}

std::string service_page(const service_text& one, const std::string& name) {
    auto kind = kind_of(one);
    auto page = fmt::format("\n{}  ({})\n", printable(one.name), ise::name_of(kind));
    auto contract = contract_of(one);
    if (!contract) return page + fmt::format("    {}\n", printable(contract.error().message(), true));
    for (std::size_t place = 0; place < one.packets.size(); ++place) {
        const auto& packet = contract->packet(place);
        // The control packets that need not be there say nothing.
        if (kind == service_kind::subscription && place != role::published && packet.type().members.empty()) continue;
        page += fmt::format("  {}\n", role::name(kind, place)) + indented(printable(packet.pretty(), true), "    ");
    }
    if (one.provided) page += "  try\n" + example(name, *contract);
    return page;
}

} // namespace

std::string example(const std::string& name, const dynamic_contract& service) {
    bool calls = service.kind() == service_kind::request_response;
    const auto& asked = service.packet(role::request);
    std::string json;
    constexpr std::size_t longest = 160;
    bool small = asked.type().min_size <= longest;
    if (small && !asked.type().members.empty()) json = " " + shell_quoted(printable(default_packet(asked).to_json()));
    if (!small || json.size() > longest) json = calls ? " -" : "";
    return fmt::format("    ise {} {} {}{}\n", calls ? "call" : "echo", name, printable(service.name()), json);
}

std::string role_page(const std::string& role, const resolution& who, std::size_t width) {
    table rows({"MEMBER", "PRIORITY", "STATE", "TAKEN"});
    for (std::size_t at = 0; at < who.members.size(); ++at)
        rows.add({who.members[at].path, std::to_string(who.members[at].priority),
                  who.members[at].ready ? "ready" : "not ready", at == 0 ? "*" : ""});
    return fmt::format("{}  (role)\n", printable(role)) + rows.text(width, "  ") + "\n";
}

std::string as_json(const component_info& about, const std::string& name, const resolution& who) {
    ordered_json told;
    if (who.role) {
        told["role"] = name;
        auto members = ordered_json::array();
        for (const auto& one : who.members) {
            ordered_json member;
            member["path"] = one.path;
            member["priority"] = one.priority;
            member["ready"] = one.ready;
            member["taken"] = &one == &who.members.front();
            members.push_back(std::move(member));
        }
        told["members"] = std::move(members);
    }
    told["path"] = about.path;
    told["state"] = about.state;
    told["host"] = about.host_name;
    told["process_id"] = about.process_id;
    told["incarnation"] = hex(about.incarnation);
    told["epoch"] = std::to_string(about.epoch); // beyond 2^53 a JSON number is not exact
    told["confirmed"] = about.confirmed;
    told["roles"] = about.roles;
    told["endpoints"] = about.endpoints;
    auto services = ordered_json::array();
    for (const auto& one : about.services) services.push_back(service_json(one));
    told["services"] = std::move(services);
    auto sessions = ordered_json::array();
    for (const auto& one : about.sessions) {
        auto session = ordered_json::parse(ise::to_json(one));
        session.erase("round_trip_ns");
        session["round_trip_s"] = static_cast<double>(one.round_trip_ns) * 1e-9;
        sessions.push_back(std::move(session));
    }
    told["sessions"] = std::move(sessions);
    told["calls_served"] = about.calls_served;
    told["packets_published"] = about.packets_published;
    told["packets_dropped"] = about.packets_dropped;
    auto ended = ordered_json::array();
    for (const auto& one : about.ended_subscriptions) ended.push_back(ordered_json::parse(ise::to_json(one)));
    told["ended_subscriptions"] = std::move(ended);
    auto waits = ordered_json::array();
    for (const auto& one : about.waits) {
        auto line = ordered_json::parse(ise::to_json(one));
        if (one.service.empty()) line["service"] = nullptr;
        line["since"] = show_wall(one.since);
        line.erase("waited");
        line["waited_s"] = std::chrono::duration<double>(one.waited).count();
        waits.push_back(std::move(line));
    }
    told["waits"] = std::move(waits);
    return told.dump(-1, ' ', false, ordered_json::error_handler_t::replace) + "\n";
}

std::string as_page(const component_info& about, const std::string& name, std::size_t width) {
    auto page =
        fmt::format("{}  {}\n", about.path.empty() ? "(anonymous)" : printable(about.path), printable(about.state));
    page += fmt::format("  host       {}, process {}\n", printable(about.host_name), about.process_id);
    std::string_view unsure =
        about.epoch != 0 && !about.confirmed ? ", unconfirmed: its lease could not be renewed" : "";
    page += fmt::format("  life       incarnation {}{}{}\n", hex(about.incarnation),
                        about.epoch == 0 ? "" : fmt::format(", epoch {}", about.epoch), unsure);
    for (const auto& [role, priority] : about.roles)
        page += fmt::format("  serves     {}, priority {}\n", printable(role), priority);
    for (std::size_t at = 0; at < about.endpoints.size(); ++at)
        page += fmt::format("  {}  {}\n", at == 0 ? "endpoints" : "         ", printable(about.endpoints[at]));
    page += fmt::format("  counts     {} calls served, {} packets published, {} dropped\n", about.calls_served,
                        about.packets_published, about.packets_dropped);

    std::string required;
    for (const auto& one : about.services) {
        if (one.provided) page += service_page(one, name);
        else
            required += fmt::format("  {}  ({}{})\n", printable(one.name), ise::name_of(kind_of(one)),
                                    one.declared ? "" : ", used");
    }
    if (!required.empty()) page += "\nrequired of others\n" + required;

    for (std::size_t at = 0; at < about.waits.size(); ++at)
        page += fmt::format("{}  {}\n", at == 0 ? "\nwaits\n" : "", printable(wait_line(about.waits[at])));

    for (std::size_t at = 0; at < about.ended_subscriptions.size(); ++at) {
        const auto& one = about.ended_subscriptions[at];
        page += fmt::format("{}  '{}' of {}: {}\n", at == 0 ? "\nsubscriptions that ended\n" : "",
                            printable(one.service), printable(one.provider), printable(one.cause));
    }

    if (!about.sessions.empty()) {
        table rows({"SESSION WITH", "IN", "OUT", "ROUND TRIP"});
        for (const auto& one : about.sessions)
            rows.add({one.peer_stalled ? one.peer + " (stalled)" : one.peer, show_bytes(one.bytes_in),
                      show_bytes(one.bytes_out),
                      one.round_trip_ns > 0 ? show_duration(duration(one.round_trip_ns)) : std::string("-")});
        page += "\n" + rows.text(width);
    }
    return page;
}

} // namespace ise::cli
