#include "needs.hpp"

#include <algorithm>
#include <map>
#include <set>
#include <utility>

namespace ise::cli {

bool service_line::concerns(const std::string& prefix) const {
    auto lies_below = [&](const std::string& path) { return naming::lies_below(path, prefix); };
    return std::ranges::any_of(providers, lies_below) || std::ranges::any_of(users, lies_below);
}

std::vector<service_line> services_of(const std::vector<surveyed>& all, bool own) {
    struct involved {
        std::set<std::string> providers, users;
        const service_info* example = nullptr;
        bool declared = false;
    };
    std::map<std::pair<std::string, std::uint8_t>, involved> found;
    bool unknown = false;
    for (const auto& one : all) {
        if (!one.about) {
            unknown = true;
            continue;
        }
        for (const auto& service : one.about->services) {
            if (!own && is_own_service(service.name)) continue;
            auto& who = found[{service.name, service.kind}];
            who.example = &service;
            (service.provided ? who.providers : who.users).insert(one.name.path);
            who.declared = who.declared || (!service.provided && service.declared);
        }
    }
    // What goes over a session is used, whatever the user has declared.
    for (const auto& one : all) {
        if (!one.about) continue;
        for (const auto& session : one.about->sessions)
            for (const auto& name : session.uses)
                for (auto& [key, who] : found)
                    if (key.first == name && who.providers.contains(peer_of(session.peer).path))
                        who.users.insert(one.name.path);
    }
    std::vector<service_line> lines;
    for (auto& [key, who] : found) {
        service_line line;
        line.name = key.first;
        line.example = who.example;
        line.missing = who.declared && who.providers.empty() && !unknown;
        line.providers.assign(who.providers.begin(), who.providers.end());
        line.users.assign(who.users.begin(), who.users.end());
        lines.push_back(std::move(line));
    }
    return lines;
}

} // namespace ise::cli
