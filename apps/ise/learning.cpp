#include "learning.hpp"

#include "text.hpp"

#include <ise/naming/services.hpp>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <optional>
#include <span>

namespace ise::cli {
namespace {

constexpr std::size_t max_sources = 4; // named in a comment
constexpr std::size_t max_pattern = access::pattern::max_bytes - 12;

bool in_one_process(const session_peer& peer) { return peer.over() == "inproc"; }

std::string list_of(const std::set<std::string>& all) {
    std::vector<std::string> some;
    for (const auto& one : all) {
        if (some.size() == max_sources)
            return fmt::format("{} and {} more", fmt::join(some, ", "), all.size() - some.size());
        some.push_back(printable(one));
    }
    return fmt::format("{}", fmt::join(some, ", "));
}

std::string identities_of(const std::set<std::string>& all) {
    std::set<std::string> shown;
    for (const auto& one : all) shown.emplace(access::shown(one));
    return list_of(shown);
}

bool fits_identity(const std::string& who) {
    return who.empty() || (fits_pattern(who) && (who.starts_with("ise://") || who.starts_with("unix:")));
}

bool fits_rule(const learned& one) {
    bool named = one.what == access::action::call || one.what == access::action::subscribe;
    return fits_identity(one.who) && fits_pattern(one.path) &&
           (!named || (fits_pattern(one.item) && one.item.find(':') == std::string::npos));
}

access::request request_of(const learned& one, std::span<const std::string> target) {
    access::request made;
    made.what = one.what;
    made.targets = target;
    made.item = one.item;
    made.priority = one.priority;
    return made;
}

std::string shown_use(const learned& one) {
    const std::string target[] = {one.path};
    return fmt::format("{} {}", access::shown(one.who), access::text_of(request_of(one, target)));
}

// One text as it is, several as {a,b}.
std::string braced(const std::vector<std::string>& all) {
    return all.size() == 1 ? all.front() : fmt::format("{{{}}}", fmt::join(all, ","));
}

// Into parts that a pattern has room for, `beside` other text.
std::vector<std::vector<std::string>> parts_of(const std::set<std::string>& all, std::size_t beside) {
    std::vector<std::vector<std::string>> made;
    std::size_t bytes = 0;
    for (const auto& one : all) {
        if (made.empty() || made.back().size() == access::pattern::max_alternatives ||
            beside + bytes + one.size() + 1 > max_pattern) {
            made.emplace_back();
            bytes = 0;
        }
        made.back().push_back(one);
        bytes += one.size() + 1;
    }
    return made;
}

struct policy_entry {
    std::string text, source;
    auto operator<=>(const policy_entry&) const = default;
};

// Paths of one folder that are used alike are one pattern, and so are the services of one component.
std::vector<policy_entry> merged_patterns(
    const std::map<std::string, std::map<std::string, std::set<std::string>>>& items_by_path) {
    struct alike {
        std::set<std::string> leaves, sources;
    };
    std::map<std::pair<std::string, std::set<std::string>>, alike> groups; // by folder and services
    for (const auto& [path, items] : items_by_path) {
        auto slash = path.rfind('/');
        std::set<std::string> names;
        for (const auto& [item, sources] : items) names.insert(item);
        auto& into = groups[{slash == path.npos ? "" : path.substr(0, slash + 1), names}];
        into.leaves.insert(slash == path.npos ? path : path.substr(slash + 1));
        for (const auto& [item, sources] : items) into.sources.insert(sources.begin(), sources.end());
    }
    std::vector<policy_entry> made;
    for (const auto& [of, group] : groups)
        for (const auto& leaves : parts_of(group.leaves, of.first.size()))
            for (const auto& items : parts_of(of.second, 0)) {
                auto text = of.first + braced(leaves);
                if (items.size() > 1 || !items.front().empty()) text += ":" + braced(items);
                made.push_back({std::move(text), list_of(group.sources)});
            }
    std::ranges::sort(made);
    return made;
}

std::string list_text(std::string_view key, const std::vector<policy_entry>& all) {
    if (all.empty()) return {};
    auto text = fmt::format("{} = [\n", key);
    for (const auto& one : all) text += fmt::format("    {}, # {}\n", one.text, one.source);
    return text + "]\n";
}

std::vector<policy_entry> as_patterns(std::vector<policy_entry> all) {
    for (auto& one : all) one.text = fmt::format("\"{}\"", one.text);
    return all;
}

using needed_uses = std::map<learned, std::set<std::string>>;

std::string rule_text(const std::string& who, const needed_uses& of) {
    std::string text = "\n";
    if (who.empty())
        text += "# Whoever has no credentials: these sessions had none. docs/security.md has how to give them some.\n";
    text += fmt::format("[[allow]]\nwho = \"{}\"\n", access::shown(who));
    for (auto what : {access::action::name, access::action::role, access::action::call, access::action::subscribe,
                      access::action::read}) {
        if (what == access::action::role) {
            std::map<std::string, std::pair<std::int32_t, std::set<std::string>>> roles;
            for (const auto& [one, sources] : of) {
                if (one.what != what) continue;
                auto& into = roles.try_emplace(one.path, one.priority, std::set<std::string>()).first->second;
                into.first = std::max(into.first, one.priority);
                into.second.insert(sources.begin(), sources.end());
            }
            std::vector<policy_entry> lines;
            for (const auto& [role, grant] : roles)
                lines.push_back(
                    {fmt::format("{{ role = \"{}\", max-priority = {} }}", role, grant.first), list_of(grant.second)});
            text += list_text("role", lines);
            continue;
        }
        std::map<std::string, std::map<std::string, std::set<std::string>>> items_by_path;
        for (const auto& [one, sources] : of)
            if (one.what == what) items_by_path[one.path][one.item].insert(sources.begin(), sources.end());
        text += list_text(access::name_of(what), as_patterns(merged_patterns(items_by_path)));
    }
    return text;
}

} // namespace

std::size_t learning::components() const noexcept {
    return static_cast<std::size_t>(std::ranges::count_if(all_, [](const auto& one) { return one.second.registered; }));
}

void learning::look(const std::vector<surveyed>& all, const std::map<std::string, std::set<std::string>>& seen_here) {
    ++looks_;
    std::map<std::string, const surveyed*> by_path;
    for (const auto& one : all) by_path.emplace(one.name.path, &one);
    for (const auto& [path, identities] : seen_here) as_seen_here_[path].insert(identities.begin(), identities.end());
    for (const auto& one : all) {
        auto& into = all_[one.name.path];
        into.registered = one.name.path != naming::server_path;
        into.process = {one.name.host_name, one.name.process_id};
        for (const auto& [role, priority] : one.name.roles) {
            auto& most = into.roles.try_emplace(role, priority).first->second;
            most = std::max(most, priority);
        }
        if (!one.about) continue;
        into.answered = true;
        for (const auto& service : one.about->services) {
            if (service.provided) into.provides[service.name].kind = service.kind;
            else into.requires_[service.name] = service.kind;
        }
        if (one.health)
            for (const auto& load : one.health->services)
                if (load.calls > 0 || load.subscribers > 0)
                    if (auto found = into.provides.find(load.name); found != into.provides.end())
                        found->second.used = true;
    }
    for (const auto& one : all)
        if (one.about) add_sessions(one, by_path);
}

void learning::add_sessions(const surveyed& of, const std::map<std::string, const surveyed*>& by_path) {
    const auto& here = of.name.path;
    const bool at_name_server = here == naming::server_path;
    for (const auto& session : of.about->sessions) {
        auto peer = peer_of(session.peer);
        if (peer.looks_only()) {
            lookers_.insert(session.who);
            continue;
        }
        if (in_one_process(peer)) { // where nothing is refused
            for (const auto& service : session.uses) within_.emplace(peer.path, service);
            continue;
        }
        if (peer.path.empty()) {
            all_[here].strangers.insert(session.who);
            continue;
        }
        all_[peer.path].identities[session.who].insert(here);
        if (at_name_server) all_[peer.path].at_name_server.insert(session.who);
        if (session.uses.empty()) continue;
        std::set<std::string> as;
        if (auto other = by_path.find(peer.path); other != by_path.end() && other->second->about)
            for (const auto& back : other->second->about->sessions)
                if (auto us = peer_of(back.peer); us.path == here && !in_one_process(us)) as.insert(back.who);
        for (const auto& service : session.uses) uses_[{here, peer.path, service}].insert(as.begin(), as.end());
    }
}

// Whose credentials registered a name: nodes do that without a path, over sessions of their own.
std::set<std::string> learning::registrars_of(const std::string& path) const {
    const auto& of = all_.at(path);
    if (!of.at_name_server.empty()) return of.at_name_server;
    for (const auto& [other, one] : all_)
        if (one.registered && one.process == of.process && !one.at_name_server.empty()) return one.at_name_server;
    auto server = all_.find(std::string(naming::server_path));
    if (server == all_.end()) return {};
    const auto& nodes = server->second.strangers;
    std::set<std::string> known;
    for (const auto& [who, by] : of.identities)
        if (nodes.contains(who)) known.insert(who);
    if (known.empty())
        if (auto seen = as_seen_here_.find(path); seen != as_seen_here_.end())
            std::ranges::set_intersection(seen->second, nodes, std::inserter(known, known.end()));
    if (!known.empty()) return known;
    return nodes.size() == 1 ? nodes : known;
}

learned_outcome learning::outcome() const {
    learned_outcome made;
    made.lookers = lookers_;
    std::set<std::string> unknown;
    auto add = [&](learned one, const std::string& source) {
        if (fits_rule(one)) made.needed[std::move(one)].insert(source);
        else unknown.insert(fmt::format("{}: it cannot be written as a pattern", printable(shown_use(one))));
    };
    for (const auto& [path, one] : all_) {
        for (const auto& [who, by] : one.identities)
            for (const auto& observer : by) add({who, access::action::name, path, {}, 0}, "seen by " + observer);
        if (path == naming::server_path && one.identities.empty())
            if (auto seen = as_seen_here_.find(path); seen != as_seen_here_.end())
                for (const auto& who : seen->second)
                    add({who, access::action::name, path, {}, 0}, "seen by this command");
        if (!one.registered) continue;
        auto registrars = registrars_of(path);
        for (const auto& who : registrars) {
            add({who, access::action::name, path, {}, 0}, "registered");
            for (const auto& [role, priority] : one.roles)
                add({who, access::action::role, role, {}, priority}, "served by " + path);
        }
        if (registrars.empty())
            unknown.insert(fmt::format("which identity registers {}{}", printable(path),
                                       one.roles.empty() ? "" : ", and its roles"));
        if (!one.answered) unknown.insert(fmt::format("what {} uses: it never answered", printable(path)));
    }
    std::set<std::pair<std::string, std::string>> known = within_;
    for (const auto& [of, seen] : uses_) {
        const auto& [user, provider, service] = of;
        known.emplace(provider, service);
        auto as = seen;
        if (as.empty()) // the provider did not answer: as others know the user
            for (const auto& [who, by] : all_.at(user).identities) as.insert(who);
        auto kind_of = [&]() -> std::optional<std::uint8_t> {
            const auto& there = all_.at(provider).provides;
            if (auto found = there.find(service); found != there.end()) return found->second.kind;
            const auto& here = all_.at(user).requires_;
            if (auto found = here.find(service); found != here.end()) return found->second;
            return {};
        };
        auto kind = kind_of();
        const bool own = service.starts_with("ise.");
        if (as.empty() || (!kind && !own)) {
            unknown.insert(fmt::format("{} used '{}' of {}: {}", printable(user), printable(service),
                                       printable(provider),
                                       as.empty() ? "as which identity was not seen"
                                                  : "whether that is called or subscribed to was not seen"));
            continue;
        }
        const bool subscribed = kind == static_cast<std::uint8_t>(service_kind::subscription);
        const std::string target[] = {provider};
        auto wanted = access::request_for(subscribed, target, service);
        for (const auto& who : as) switch (wanted.what) {
                case access::action::call:
                case access::action::subscribe: add({who, wanted.what, provider, service, 0}, "by " + user); break;
                case access::action::read: add({who, access::action::read, provider, {}, 0}, "by " + user); break;
                case access::action::set:
                case access::action::start:
                case access::action::stop:
                    unknown.insert(fmt::format("which {} {} ({}) may {} by '{}' of {}",
                                               wanted.what == access::action::set ? "parameters" : "components",
                                               access::shown(who), printable(user),
                                               wanted.what == access::action::set ? "set" : "start and stop",
                                               printable(service), printable(provider)));
                    break;
                default: break; // of the name server, for whoever has a rule
            }
    }
    for (const auto& [path, one] : all_)
        for (const auto& [name, service] : one.provides)
            if (service.used && !name.starts_with("ise.") && !known.contains({path, name}))
                unknown.insert(fmt::format(
                    "who used '{}' of {}{}", printable(name), printable(path),
                    one.strangers.empty()
                        ? std::string()
                        : fmt::format("; it had sessions with {} without a path", identities_of(one.strangers))));
    made.unknown.assign(unknown.begin(), unknown.end());
    return made;
}

bool fits_pattern(std::string_view text) {
    return !text.empty() && text.size() < max_pattern / 2 && std::ranges::all_of(text, [](unsigned char one) {
        return one >= 0x20 && one < 0x7f &&
               std::string_view("*{},\"\\").find(static_cast<char>(one)) == std::string_view::npos;
    });
}

std::string policy_text(const learned_outcome& of, const learned_head& head) {
    auto text = fmt::format(
        "# Written by `ise access learn` at {}: what {} component{} used within {}, in {} look{}.\n"
        "# It allows what was seen, and nothing else. What is used rarely, for less than the second\n"
        "# between two looks, by a program without a path, or within one process only is not in it:\n"
        "# the audit log has a line for each refusal (docs/access.md).\n",
        head.at, head.components, head.components == 1 ? "" : "s", head.length, head.looks, head.looks == 1 ? "" : "s");
    if (!of.unknown.empty()) {
        text += "#\n# Not seen, and not allowed unless a rule below does; add it by hand:\n";
        for (const auto& one : of.unknown) text += fmt::format("# - {}\n", printable(one));
    }
    text += "version = 1\n";
    std::map<std::string, needed_uses> by_identity;
    for (const auto& [one, sources] : of.needed) by_identity[one.who].emplace(one, sources);
    for (const auto& [who, all] : by_identity) text += rule_text(who, all);
    std::vector<std::string> people;
    for (const auto& who : of.lookers)
        if (fits_identity(who)) people.push_back(fmt::format("\"{}\"", access::shown(who)));
    if (!people.empty())
        text +=
            fmt::format("\n# Commands that look at the system, such as this one and `ise top`, are no part of it. To "
                        "allow them:\n# [[allow]]\n# who = [{}]\n# name = [\"ise/cli/*\"]\n# read = [\"**\"]\n",
                        fmt::join(people, ", "));
    return text;
}

std::string objection_to_policy(const std::string& text, const learned_outcome& of) {
    std::vector<access::remark> problems;
    auto made = access::policy::parse(text, "access.toml", problems);
    if (!made) {
        std::string all;
        for (const auto& one : problems)
            all += fmt::format("{}{}:{}: {}", all.empty() ? "" : "; ", one.line, one.column, one.text);
        return all;
    }
    for (const auto& [one, sources] : of.needed) {
        const std::string target[] = {one.path};
        if (!made->decide(one.who, request_of(one, target)).allowed) return "it does not allow " + shown_use(one);
    }
    return {};
}

} // namespace ise::cli
