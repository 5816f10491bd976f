// ise describe: what a component tells about itself.
#include "findings.hpp"
#include "json.hpp"
#include "options.hpp"
#include "table.hpp"
#include "target.hpp"
#include "text.hpp"

#include <ise/component/introspection.hpp>
#include <ise/core/time_text.hpp>
#include <ise/service/action.hpp>
#include <ise/service/resolver.hpp>
#include <ise/service/service_host.hpp>
#include <ise/service/session.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <utility>

namespace ise::cli {
namespace {

struct describe_options {
    std::string name;
    bool all = false;   ///< ISE's own services too
    bool names = false; ///< nothing but the names of its services
};

struct described_member {
    std::string path;
    std::int32_t priority = 0;
    bool ready = false, taken = false;
};
struct described_packet {
    std::string_view role;
    std::string fingerprint, schema;
};
struct described_service {
    std::string name;
    std::string_view kind;
    bool provided = false;
    std::vector<described_packet> packets;
    bool declared = false;
};
struct described_session {
    std::string peer;
    std::uint64_t bytes_in = 0, bytes_out = 0;
    bool peer_stalled = false;
    std::vector<std::string> uses;
    duration round_trip_s{};
    if_any<std::string> who;
};
struct described_wait {
    std::string target;
    std::optional<std::string> service;
    std::string stage, since, cause;
    duration waited_s{};
};
struct description {
    if_any<std::string> role; ///< under which it was found, with all its members
    if_any<std::vector<described_member>> members;
    std::string path, state, host;
    if_any<std::string> identity; ///< that was verified of it
    if_any<std::string> user;
    std::uint64_t process_id = 0;
    std::string incarnation;
    std::string epoch; ///< beyond 2^53 a JSON number is not exact
    bool confirmed = false;
    std::map<std::string, std::int32_t> roles;
    std::vector<std::string> endpoints;
    std::vector<described_service> services;
    std::vector<described_session> sessions;
    std::uint64_t calls_served = 0, packets_published = 0, packets_dropped = 0;
    std::vector<ended_subscription_info> ended_subscriptions;
    std::vector<described_wait> waits;
};

std::string hex(std::uint64_t number) { return fmt::format("{:016x}", number); }

described_service describe_one(const service_info& one) {
    described_service made{one.name, kind_name(one), one.provided, {}, one.declared};
    for (std::size_t place = 0; place < one.packets.size(); ++place)
        made.packets.push_back(
            {role::name(kind_of(one), place), hex(one.packets[place].fingerprint), one.packets[place].schema});
    return made;
}

// The identity that the session with it has verified.
std::string identity_there(component& self, const component_info& about) {
    for (const auto& [raw, held] : self.services().sessions())
        if (held->peer().incarnation == about.incarnation) return held->verified().who;
    return {};
}

description description_of(const component_info& about, const std::string& identity, const std::string& name,
                           const resolution& who) {
    description made{.path = about.path,
                     .state = about.state,
                     .host = about.host_name,
                     .process_id = about.process_id,
                     .incarnation = hex(about.incarnation),
                     .epoch = std::to_string(about.epoch),
                     .confirmed = about.confirmed,
                     .roles = about.roles,
                     .endpoints = about.endpoints,
                     .calls_served = about.calls_served,
                     .packets_published = about.packets_published,
                     .packets_dropped = about.packets_dropped,
                     .ended_subscriptions = about.ended_subscriptions};
    if (!identity.empty()) made.identity = identity;
    if (!about.user.empty()) made.user = about.user;
    if (who.role) {
        made.role = name;
        made.members.emplace();
        for (const auto& one : who.members)
            made.members->push_back({one.path, one.priority, one.ready, &one == &who.members.front()});
    }
    for (const auto& one : about.services) made.services.push_back(describe_one(one));
    for (const auto& one : about.sessions) {
        made.sessions.push_back(
            {one.peer, one.bytes_in, one.bytes_out, one.peer_stalled, one.uses, duration(one.round_trip_ns), {}});
        if (!one.who.empty()) made.sessions.back().who = one.who;
    }
    for (const auto& one : about.waits) {
        made.waits.push_back({one.target, {}, one.stage, iso_8601(one.since), one.cause, one.waited});
        if (!one.service.empty()) made.waits.back().service = one.service;
    }
    return made;
}

std::string service_page(const service_info& one, const std::string& name) {
    auto kind = kind_of(one);
    auto page = fmt::format("\n{}  ({})\n", printable(one.name), kind_name(one));
    auto contract = contract_of(one);
    if (contract && is_action(*contract->types())) {
        auto types = schemas_of_action(*contract->types());
        for (const auto& [name_of_part, packet] :
             {std::pair("goal", &types.goal), std::pair("feedback", &types.feedback),
              std::pair("result", &types.result)})
            page += fmt::format("  {}\n", name_of_part) + indented(printable(packet->pretty(), true), "    ");
        return one.provided ? page + "  try\n" + example(name, *contract) : page;
    }
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

std::string role_page(const std::string& role, const resolution& who, std::size_t width) {
    table rows({"MEMBER", "PRIORITY", "STATE", "TAKEN"});
    for (std::size_t at = 0; at < who.members.size(); ++at)
        rows.add({who.members[at].path, std::to_string(who.members[at].priority),
                  who.members[at].ready ? "ready" : "not ready", at == 0 ? "*" : ""});
    return fmt::format("{}  (role)\n", printable(role)) + rows.text(width, "  ") + "\n";
}

std::string component_page(const component_info& about, const std::string& identity, const std::string& name,
                           std::size_t width) {
    auto page =
        fmt::format("{}  {}\n", about.path.empty() ? "(anonymous)" : printable(about.path), printable(about.state));
    page += fmt::format("  host       {}, process {}{}\n", printable(about.host_name), about.process_id,
                        about.user.empty() ? "" : fmt::format(", user {}", printable(about.user)));
    if (!identity.empty()) page += fmt::format("  identity   {}\n", printable(identity));
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
            required +=
                fmt::format("  {}  ({}{})\n", printable(one.name), kind_name(one), one.declared ? "" : ", used");
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
        table rows({"SESSION WITH", "IN", "OUT", "ROUND TRIP", "WHO"});
        for (const auto& one : about.sessions)
            rows.add({one.peer_stalled ? one.peer + " (stalled)" : one.peer, show_bytes(one.bytes_in),
                      show_bytes(one.bytes_out),
                      one.round_trip_ns > 0 ? show_duration(duration(one.round_trip_ns)) : std::string("-"),
                      one.who.empty() ? "-" : one.who});
        page += "\n" + rows.text(width);
    }
    return page;
}

task<> describe(context& in, describe_options options) {
    auto who = co_await reach(in, options.name);
    auto about = co_await ask_about(in, who);
    const auto identity = identity_there(in.self, about);
    std::string text;
    if (options.names) {
        for (const auto& one : about.services)
            if (one.provided && (options.all || !is_own_service(one.name))) text += printable(one.name) + "\n";
    } else {
        if (!options.all) std::erase_if(about.services, [](const auto& one) { return is_own_service(one.name); });
        auto members = co_await members_of(in, options.name);
        if (in.set.json) {
            text = json_line(description_of(about, identity, options.name, members));
        } else {
            if (members.role) text = role_page(options.name, members, in.out.width());
            text += component_page(about, identity, options.name, in.out.width());
        }
    }
    co_await in.out.write(in.self, std::move(text));
}

void declare_describe(command_line::app& app, parsed_command& made) {
    auto given = std::make_shared<describe_options>();
    add_component(app, given->name);
    app.add_flag("--all", given->all, "ISE's own services too");
    app.add_flag("--names", given->names, "only the names of its services");
    app.callback([&made, given] { made.work = [given](context& in) { return describe(in, *given); }; });
}

} // namespace

extern const command describe_command{
    "describe", see_group, "shows endpoints, services, packets and sessions of a component",
    "  ise describe atirma/boat\n  ise describe tcp://127.0.0.1:7411        without a name server\n", declare_describe};

} // namespace ise::cli
