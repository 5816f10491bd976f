#include "connections.hpp"

#include "text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <set>
#include <utility>

namespace ise::cli {
namespace {

void add(connection_line& to, const session_text& session, const session_peer& peer) {
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

void add_services(connection_line& to, const session_text& session, bool a_provides) {
    for (const auto& name : session.uses) {
        auto same = [&](const service_use& one) { return one.service == name && one.a_provides == a_provides; };
        if (!is_own_service(name) && std::ranges::none_of(to.services, same)) to.services.push_back({name, a_provides});
    }
}

std::string plural(std::size_t count) { return count > 1 ? fmt::format("{} sessions, ", count) : std::string(); }

// What `me` has of it.
std::string session_row(const connection_line& line, bool me_is_a) {
    const auto& other = me_is_a ? line.b : line.a;
    auto text = other.empty() ? fmt::format("(anonymous, {})", line.address) : other;
    text += "  " + line.over;
    std::string uses, gives;
    for (const auto& one : line.services) {
        auto& into = one.a_provides == me_is_a ? gives : uses;
        into += (into.empty() ? "" : ", ") + one.service;
    }
    if (!uses.empty()) text += "  uses " + uses;
    if (!gives.empty()) text += "  gives " + gives;
    text += fmt::format("  ({}{} in, {} out", plural(line.sessions),
                        show_bytes(me_is_a ? line.bytes_to_a : line.bytes_to_b),
                        show_bytes(me_is_a ? line.bytes_to_b : line.bytes_to_a));
    if (line.round_trip > duration{}) text += ", round trip " + show_duration(line.round_trip);
    return printable(text) + (line.stalled ? ", stalled)" : ")");
}

std::string dot_quoted(const std::string& text) {
    std::string out = "\"";
    for (char letter : printable(text)) {
        if (letter == '"' || letter == '\\') out += '\\';
        out += letter;
    }
    return out + "\"";
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

std::string connections_as_tree(const std::vector<surveyed>& all, const std::vector<connection_line>& lines) {
    std::string text;
    for (const auto& one : all) {
        const auto& path = one.name.path;
        text += fmt::format("{}  {}, {}\n", printable(path),
                            one.about ? printable(one.about->state) : "does not answer", printable(one.name.host_name));
        std::vector<std::string> rows;
        for (const auto& line : lines) {
            if (line.a == path) rows.push_back(session_row(line, true));
            if (line.b == path && line.a != path) rows.push_back(session_row(line, false));
        }
        for (std::size_t at = 0; at < rows.size(); ++at)
            text += (at + 1 == rows.size() ? "└─ " : "├─ ") + rows[at] + "\n";
    }
    return text;
}

std::string connections_as_dot(const std::vector<surveyed>& all, const std::vector<connection_line>& lines) {
    std::string text = "digraph ise {\n  rankdir=LR;\n  node [shape=box];\n";
    std::set<std::string> told;
    for (const auto& one : all) {
        told.insert(one.name.path);
        text += fmt::format("  {}{};\n", dot_quoted(one.name.path), one.about ? "" : " [style=dashed]");
    }
    std::size_t strangers = 0;
    for (const auto& line : lines) {
        auto a = dot_quoted(line.a), b = dot_quoted(line.b);
        if (line.b.empty()) {
            b = fmt::format("\"anonymous {}\"", ++strangers);
            text += fmt::format("  {} [label={} style=dotted];\n", b, dot_quoted(line.address));
        }
        for (const auto* name :
             {&line.a, &line.b}) // of a peer that is not registered, or outside of what was asked for
            if (!name->empty() && told.insert(*name).second)
                text += fmt::format("  {} [style=dashed];\n", dot_quoted(*name));
        if (line.services.empty())
            text += fmt::format("  {} -> {} [label={} dir=none];\n", a, b, dot_quoted(line.over));
        for (const auto& one : line.services)
            text += fmt::format("  {} -> {} [label={}];\n", one.a_provides ? b : a, one.a_provides ? a : b,
                                dot_quoted(fmt::format("{} ({})", one.service, line.over)));
    }
    return text + "}\n";
}

} // namespace ise::cli
