#include "connections.hpp"

#include <algorithm>
#include <map>
#include <utility>

namespace ise::cli {
namespace {

void add(connection_line& to, const session_info& session, const session_peer& peer) {
    if (to.address.empty()) to.address = peer.address;
    auto over = peer.over();
    if (to.over.empty()) to.over = over;
    else if (to.over.find(over) == std::string::npos) to.over += "+" + over;
    ++to.sessions;
    to.bytes_to_a += session.bytes_in;
    to.bytes_to_b += session.bytes_out;
    to.round_trip = std::max(to.round_trip, duration(session.round_trip_ns));
    to.stalled = to.stalled || session.peer_stalled;
}

void add_services(connection_line& to, const session_info& session, bool a_provides) {
    for (const auto& name : session.uses) {
        auto same = [&](const service_use& one) { return one.service == name && one.a_provides == a_provides; };
        if (!is_own_service(name) && std::ranges::none_of(to.services, same)) to.services.push_back({name, a_provides});
    }
}

} // namespace

std::vector<connection_line> connections_of(const std::vector<surveyed>& all) {
    // Both ends tell of a session: what the first of them tells counts, and the other says whether there are more.
    std::map<std::pair<std::string, std::string>, std::pair<connection_line, connection_line>> pairs;
    std::vector<connection_line> lines;
    for (const auto& one : all) {
        if (!one.about) continue;
        std::map<std::string, connection_line> strangers;
        for (const auto& session : one.about->sessions) {
            auto peer = peer_of(session.peer);
            if (peer.looks_only()) continue;
            if (peer.path.empty()) {
                auto& line = strangers[peer.address];
                line.a = one.name.path;
                add(line, session, peer);
                add_services(line, session, false);
                continue;
            }
            bool first = one.name.path <= peer.path;
            auto& both = pairs[first ? std::pair(one.name.path, peer.path) : std::pair(peer.path, one.name.path)];
            auto& line = first ? both.first : both.second;
            line.a = one.name.path;
            line.b = peer.path;
            add(line, session, peer);
            add_services(both.first, session, !first); // each end tells what it uses itself
        }
        for (auto& [address, line] : strangers) lines.push_back(std::move(line));
    }
    for (auto& [names, both] : pairs) {
        bool seen_by_first = both.first.sessions > 0;
        auto line = seen_by_first ? both.first : both.second;
        line.sessions = std::max(both.first.sessions, both.second.sessions);
        line.stalled = both.first.stalled || both.second.stalled;
        line.round_trip = std::max(both.first.round_trip, both.second.round_trip);
        if (!seen_by_first) {
            std::swap(line.a, line.b);
            std::swap(line.bytes_to_a, line.bytes_to_b);
        }
        line.services = std::move(both.first.services);
        std::ranges::sort(line.services, {},
                          [](const service_use& one) { return std::tie(one.a_provides, one.service); });
        lines.push_back(std::move(line));
    }
    std::ranges::sort(lines, {}, [](const connection_line& one) { return std::tie(one.a, one.b, one.address); });
    return lines;
}

} // namespace ise::cli
