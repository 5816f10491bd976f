#include <ise/name_server/registry_limits.hpp>

#include <ise/core/limits.hpp>

#include <fmt/format.h>

#include <algorithm>

namespace ise {
namespace {

std::optional<std::string> objection_to_path(const std::string& path, const registry_limits& limits) {
    if (path.size() > limits.max_path_bytes)
        return fmt::format("a path of {} bytes, max_path_bytes is {}", path.size(), limits.max_path_bytes);
    if (!naming::is_path(path)) return "not a path of a component: write it like atirma/shore/xbee";
    return std::nullopt;
}

} // namespace

std::size_t memory_of(const naming::component_claim& claim) {
    constexpr std::size_t entry = 96; // of a map or set, with an empty text
    std::size_t total = sizeof claim + entry + 3 * (entry + claim.path.size()) + claim.type.size() +
                        claim.state.size() + claim.waits_for.size();
    for (const auto& endpoint : claim.endpoints) total += sizeof endpoint + endpoint.size();
    for (const auto& service : claim.services)
        total += sizeof service + service.name.size() + service.fingerprints.size() * (sizeof(std::uint64_t) + entry);
    for (const auto& [role, priority] : claim.roles) total += 4 * entry + 3 * role.size() + claim.path.size();
    return total;
}

std::optional<std::string> objection_to(const naming::node_identity& who, const registry_limits& limits) {
    if (who.lease_key == 0) return "a node without a lease key";
    auto longest = limits.max_text_bytes;
    for (const auto* text : {&who.name, &who.host_name, &who.host_key, &who.process_key, &who.launch_mark})
        if (text->size() > longest)
            return fmt::format("a text of the node has {} bytes, max_text_bytes is {}", text->size(), longest);
    return std::nullopt;
}

std::optional<std::string> objection_to(const naming::component_claim& claim, const registry_limits& limits) {
    if (auto why = objection_to_path(claim.path, limits)) return why;
    if (claim.endpoints.size() > limits.max_endpoints_per_component)
        return fmt::format("{} endpoints, max_endpoints_per_component is {}", claim.endpoints.size(),
                           limits.max_endpoints_per_component);
    if (claim.services.size() > limits.max_services_per_component)
        return fmt::format("{} services, max_services_per_component is {}", claim.services.size(),
                           limits.max_services_per_component);
    if (claim.roles.size() > limits.max_roles_per_component)
        return fmt::format("{} roles, max_roles_per_component is {}", claim.roles.size(),
                           limits.max_roles_per_component);
    for (const auto& [role, priority] : claim.roles) {
        if (auto why = objection_to_path(role, limits))
            return fmt::format("the role '{}' is {}", role.substr(0, limits.max_path_bytes), *why);
        if (role == claim.path) return std::string("a role of the component's own name: its name is found without it");
    }
    auto too_long = [&](const std::string& text) { return text.size() > limits.max_text_bytes; };
    if (too_long(claim.type) || too_long(claim.state) || too_long(claim.waits_for) ||
        std::ranges::any_of(claim.endpoints, too_long) ||
        std::ranges::any_of(claim.services, too_long, &naming::service_entry::name))
        return fmt::format("a type, state, endpoint, service name or wait of more than max_text_bytes, which is {}",
                           limits.max_text_bytes);
    for (const auto& service : claim.services)
        if (service.fingerprints.size() > limit::service_fingerprints)
            return fmt::format("the service '{}' names {} packets, service_fingerprints is {}", service.name,
                               service.fingerprints.size(), limit::service_fingerprints);
    return std::nullopt;
}

} // namespace ise
