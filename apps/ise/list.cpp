// ise list: the components that the name server knows.
#include "json.hpp"
#include "options.hpp"
#include "table.hpp"
#include "target.hpp"
#include "text.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <map>
#include <memory>

namespace ise::cli {
namespace {

struct list_options {
    std::string prefix;
    bool names = false; ///< nothing but the paths
};

struct listed_role {
    std::string role;
    std::int32_t priority = 0;
    bool taken = false; ///< clients that look for the role now get this component
};
struct listed_component {
    std::string path, state, type, host;
    std::uint64_t process_id = 0;
    std::string node;
    std::string epoch; ///< beyond 2^53 a JSON number is not exact
    std::string incarnation;
    duration lease_age_s{};
    std::vector<std::string> endpoints;
    std::uint64_t services_provided = 0;
    std::optional<std::string> waits_for;
    std::vector<listed_role> roles;
};

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

std::vector<listed_component> listed_components(const std::vector<naming::listed_name>& names,
                                                const role_lists& roles) {
    std::vector<listed_component> all;
    for (const auto& one : names) {
        listed_component made{.path = one.path,
                              .state = one.state,
                              .type = one.type,
                              .host = one.host_name,
                              .process_id = one.process_id,
                              .node = one.node,
                              .epoch = std::to_string(one.epoch),
                              .incarnation = fmt::format("{:016x}", one.incarnation),
                              .lease_age_s = one.lease_age,
                              .endpoints = one.endpoints,
                              .services_provided = one.services_provided};
        if (!one.waits_for.empty()) made.waits_for = one.waits_for;
        for (const auto& [role, priority] : one.roles)
            made.roles.push_back({role, priority, roles.at(role).front().path == one.path});
        all.push_back(std::move(made));
    }
    return all;
}

// What does not work, then the user's components, then ISE's own.
std::vector<naming::listed_name> for_people(std::vector<naming::listed_name> names) {
    std::ranges::stable_sort(names, {}, [](const auto& one) {
        bool waits = !one.waits_for.empty();
        return one.state != "ready" || waits ? 0 : one.path.starts_with("ise/") ? 2 : 1;
    });
    return names;
}

std::string component_table(const std::vector<naming::listed_name>& names, std::size_t width) {
    table rows({"PATH", "STATE", "HOST", "PROCESS", "SERVICES", "LEASE AGE", "ENDPOINTS"});
    std::size_t longest = 0;
    for (const auto& one : names) {
        auto endpoints = reachable_first(one.endpoints);
        if (!endpoints.empty()) longest = std::max(longest, columns(endpoints.front()));
        auto state = one.waits_for.empty() ? one.state : fmt::format("{}, waits for {}", one.state, one.waits_for);
        rows.add({one.path, state, one.host_name, std::to_string(one.process_id), std::to_string(one.services_provided),
                  show_duration(one.lease_age), fmt::format("{}", fmt::join(endpoints, " "))});
    }
    constexpr std::size_t cut_mark = 2; // " …"
    return rows.text(width, {}, {"LEASE AGE", "SERVICES", "PROCESS", "HOST"}, longest + cut_mark);
}

// Who is found under a role is marked: the handles of others may be with another member.
std::string role_table(const role_lists& roles, const std::string& prefix, std::size_t width) {
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
        text = json_line(listed_components(names, roles));
    } else {
        served = role_table(roles, options.prefix, in.out.width());
        if (!names.empty() || served.empty()) text = component_table(for_people(names), in.out.width());
        if (!served.empty()) text += (text.empty() ? "" : "\n") + served;
    }
    co_await in.out.write(in.self, std::move(text));
    if (!names.empty() || !served.empty() || options.names) co_return;
    std::vector<std::string> known;
    for (const auto& one : all) known.push_back(one.path);
    for (const auto& [role, members] : roles) known.push_back(role);
    note_nothing(in, options.prefix, known);
}

void declare_list(command_line::app& app, parsed_command& made) {
    auto given = std::make_shared<list_options>();
    add_prefix(app, given->prefix);
    app.add_flag("--names", given->names, "only the paths");
    app.callback([&made, given] { made.work = [given](context& in) { return list(in, *given); }; });
}

} // namespace

extern const command list_command{"list", see_group, "lists the components that the name server knows",
                                  "  ise list\n  ise list atirma/shore\n", declare_list};

} // namespace ise::cli
