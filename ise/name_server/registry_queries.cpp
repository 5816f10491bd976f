#include <ise/name_server/registry.hpp>

#include <fmt/format.h>

#include <algorithm>

// What others ask the registry; nothing here changes it, but for leases that are over.
namespace ise {

result<naming::resolve_response> registry::resolve(std::string_view path, time_point now) {
    auto at = running_time(now);
    expire(at);
    auto held = find(path);
    if (held == components_.end() && roles_.contains(path)) {
        auto serving = members_of(path, now);
        naming::resolve_response found;
        const auto& best = serving.members.front();
        found.path = serving.role;
        found.epoch = best.epoch;
        found.incarnation = best.incarnation;
        found.host_name = best.host_name;
        found.host_key = best.host_key;
        found.process_key = best.process_key;
        found.endpoints = best.endpoints;
        found.members = std::move(serving.members);
        found.certain = serving.certain;
        return found;
    }
    if (held == components_.end()) {
        if (at < recovered_)
            return failure(errc::name_server_lost,
                           fmt::format("the name server has just started and may not yet know '{}'", path));
        return failure(errc::no_such_name, fmt::format("no component is registered as '{}'", path));
    }
    const auto& entry = held->second;
    naming::resolve_response found;
    found.path = held->first;
    found.epoch = entry.claim.epoch;
    found.incarnation = entry.claim.incarnation;
    found.host_name = entry.owner->who.host_name;
    found.host_key = entry.owner->who.host_key;
    found.process_key = entry.owner->who.process_key;
    found.endpoints = entry.claim.endpoints;
    return found;
}

naming::role_members registry::members_of(std::string_view role, time_point now) {
    auto at = running_time(now);
    expire(at);
    naming::role_members found;
    found.role = role;
    found.certain = at >= recovered_;
    auto known = roles_.find(role);
    if (known == roles_.end()) return found;
    for (const auto& path : known->second) {
        const auto& who = find(path)->second;
        found.members.push_back(member(who, who.claim.roles.at(found.role)));
    }
    std::ranges::sort(found.members, {},
                      [](const auto& one) { return naming::role_rank(one.state, one.priority, one.epoch); });
    return found;
}

naming::role_member registry::member(const component& who, std::int32_t priority) const {
    naming::role_member made;
    made.path = who.claim.path;
    made.priority = priority;
    made.state = who.claim.state;
    made.epoch = who.claim.epoch;
    made.incarnation = who.claim.incarnation;
    made.host_name = who.owner->who.host_name;
    made.host_key = who.owner->who.host_key;
    made.process_key = who.owner->who.process_key;
    made.endpoints = who.claim.endpoints;
    return made;
}

naming::list_response registry::list(const naming::list_request& request, time_point now) {
    expire(running_time(now));
    naming::list_response response;
    auto most = request.limit == 0 ? options_.limits.max_listed
                                   : std::min<std::size_t>(request.limit, options_.limits.max_listed);
    std::size_t listed_bytes = 0;
    std::string_view prefix = request.prefix;
    while (prefix.ends_with('/')) prefix.remove_suffix(1);
    auto at = request.after.empty() || request.after < prefix ? components_.lower_bound(prefix)
                                                              : components_.upper_bound(request.after);
    for (; at != components_.end() && std::string_view(at->first).starts_with(prefix); ++at) {
        if (!naming::lies_below(at->first, prefix)) continue; // "atirma2" beside "atirma"
        if (response.names.size() == most || listed_bytes >= options_.limits.max_listed_bytes) {
            response.more = true;
            break;
        }
        listed_bytes += memory_of(at->second.claim);
        response.names.push_back(listed(at->second));
        if (const auto& owner = *at->second.owner; !kept_elsewhere(owner))
            response.names.back().lease_age = running_time(now) - owner.renewed;
    }
    return response;
}

naming::lost_response registry::lost(std::string_view prefix, time_point now) {
    auto at = running_time(now);
    expire(at);
    naming::lost_response response;
    while (prefix.ends_with('/')) prefix.remove_suffix(1);
    for (auto one = last_held_.lower_bound(prefix); one != last_held_.end() && one->first.starts_with(prefix); ++one) {
        if (one->second.why == end_of_lease::reported || !naming::lies_below(one->first, prefix)) continue;
        if (response.names.size() == options_.limits.max_listed) break;
        naming::lost_name made;
        made.path = one->first;
        made.host_name = one->second.host_name;
        made.process_id = one->second.process_id;
        made.lost_ago = at - one->second.at;
        response.names.push_back(std::move(made));
    }
    return response;
}

result<naming::describe_response> registry::describe(std::string_view path, time_point now) {
    auto at = running_time(now);
    expire(at);
    auto held = find(path);
    if (held == components_.end())
        return failure(errc::no_such_name, fmt::format("no component is registered as '{}'", path));
    const auto& entry = held->second;
    naming::describe_response response;
    response.name = listed(entry);
    response.services = entry.claim.services;
    schemas_.collect(entry.claim.services, response.schemas);
    if (kept_elsewhere(*entry.owner)) return response;
    response.lease = entry.owner->lease;
    response.lease_age = at - entry.owner->renewed;
    return response;
}

naming::listed_name registry::listed(const component& held) const {
    naming::listed_name made;
    made.path = held.claim.path;
    made.epoch = held.claim.epoch;
    made.incarnation = held.claim.incarnation;
    made.type = held.claim.type;
    made.state = held.claim.state;
    made.node = held.owner->who.name;
    made.host_name = held.owner->who.host_name;
    made.process_id = held.owner->who.process_id;
    made.endpoints = held.claim.endpoints;
    made.roles = held.claim.roles;
    made.waits_for = held.claim.waits_for;
    auto own = [](const naming::service_entry& one) {
        return one.provided && !one.name.starts_with("ise.");
    }; // ISE's are everybody's
    made.services_provided = static_cast<std::uint32_t>(std::ranges::count_if(held.claim.services, own));
    return made;
}

std::vector<naming::name_event> registry::snapshot(std::string_view prefix) const {
    std::vector<naming::name_event> all;
    while (prefix.ends_with('/')) prefix.remove_suffix(1);
    for (auto at = components_.lower_bound(prefix);
         at != components_.end() && std::string_view(at->first).starts_with(prefix); ++at) {
        if (!naming::lies_below(at->first, prefix)) continue;
        naming::name_event event;
        event.name = listed(at->second);
        all.push_back(std::move(event));
    }
    return all;
}

} // namespace ise
