#include "commands.hpp"

#include "table.hpp"
#include "target.hpp"
#include "text.hpp"

#include <nlohmann/json.hpp>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <map>

namespace ise::cli {
namespace {

using nlohmann::ordered_json;
using role_lists = std::map<std::string, std::vector<naming::listed_name>>; // who serves each role, best first

role_lists roles_of(const std::vector<naming::listed_name>& names) {
    role_lists all;
    for (const auto& one : names)
        for (const auto& [role, priority] : one.roles) all[role].push_back(one);
    for (auto& [role, members] : all)
        std::ranges::sort(members, {},
                          [&](const auto& one) { return naming::role_rank(one.state, one.roles.at(role), one.epoch); });
    return all;
}

std::string as_json(const std::vector<naming::listed_name>& names, const role_lists& roles) {
    auto all = ordered_json::array();
    for (const auto& one : names) {
        ordered_json told;
        told["path"] = one.path;
        told["state"] = one.state;
        told["type"] = one.type;
        told["host"] = one.host_name;
        told["process_id"] = one.process_id;
        told["node"] = one.node;
        told["epoch"] = std::to_string(one.epoch); // beyond 2^53 a JSON number is not exact
        told["incarnation"] = fmt::format("{:016x}", one.incarnation);
        told["lease_age_s"] = std::chrono::duration<double>(one.lease_age).count();
        told["endpoints"] = one.endpoints;
        told["services_provided"] = one.services_provided;
        told["waits_for"] = one.waits_for.empty() ? ordered_json() : ordered_json(one.waits_for);
        auto served = ordered_json::array();
        for (const auto& [role, priority] : one.roles) {
            ordered_json membership;
            membership["role"] = role;
            membership["priority"] = priority;
            membership["taken"] = roles.at(role).front().path == one.path;
            served.push_back(std::move(membership));
        }
        told["roles"] = std::move(served);
        all.push_back(std::move(told));
    }
    return all.dump(-1, ' ', false, ordered_json::error_handler_t::replace) + "\n";
}

std::string as_table(const std::vector<naming::listed_name>& names, std::size_t width) {
    table rows({"PATH", "STATE", "HOST", "PROCESS", "LEASE AGE", "SERVICES", "ENDPOINTS"});
    std::size_t longest = 0;
    for (const auto& one : names) {
        auto endpoints = reachable_first(one.endpoints);
        if (!endpoints.empty()) longest = std::max(longest, columns(endpoints.front()));
        auto state = one.waits_for.empty() ? one.state : fmt::format("{}, waits for {}", one.state, one.waits_for);
        rows.add({one.path, state, one.host_name, std::to_string(one.process_id), show_duration(one.lease_age),
                  std::to_string(one.services_provided), fmt::format("{}", fmt::join(endpoints, " "))});
    }
    constexpr std::size_t cut_mark = 2; // " …"
    return rows.text(width, {}, {"SERVICES", "LEASE AGE", "PROCESS", "HOST"}, longest + cut_mark);
}

// Who is found under a role is marked: the handles of others may be with another member.
std::string as_table(const role_lists& roles, const std::string& prefix, std::size_t width) {
    table rows({"ROLE", "TAKEN", "PRIORITY", "STATE", "HOST", "MEMBER"});
    std::size_t shown = 0;
    for (const auto& [role, members] : roles) {
        if (!naming::lies_below(role, prefix)) continue;
        for (const auto& one : members) {
            rows.add({role, &one == &members.front() ? "*" : "", std::to_string(one.roles.at(role)), one.state,
                      one.host_name, one.path});
            ++shown;
        }
    }
    return shown == 0 ? std::string() : rows.text(width);
}

} // namespace

task<> list(context& in, list_options options) {
    check_prefix(options.prefix);
    // A role may be served by components of any path.
    auto all = co_await listed_names(in, "");
    auto roles = roles_of(all);
    auto names = all;
    std::erase_if(names, [&](const auto& one) { return !naming::lies_below(one.path, options.prefix); });
    std::string text, served;
    if (options.names) {
        for (const auto& one : names) text += printable(one.path) + "\n";
        for (const auto& [role, members] : roles)
            if (naming::lies_below(role, options.prefix)) text += printable(role) + "\n";
    } else if (in.set.json) {
        text = as_json(names, roles);
    } else {
        served = as_table(roles, options.prefix, in.out.width());
        if (!names.empty() || served.empty()) text = as_table(names, in.out.width());
        if (!served.empty()) text += (text.empty() ? "" : "\n") + served;
    }
    co_await in.out.write(in.self, std::move(text));
    if (!names.empty() || !served.empty() || options.names) co_return;
    std::vector<std::string> known;
    for (const auto& one : all) known.push_back(one.path);
    for (const auto& [role, members] : roles) known.push_back(role);
    note_nothing(in, options.prefix, known);
}

} // namespace ise::cli
