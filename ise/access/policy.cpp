#include <ise/access/policy.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <array>

namespace ise::access {
namespace {

constexpr std::array<std::string_view, actions> action_names = {"call", "subscribe", "read", "name",   "role",
                                                                "set",  "start",     "stop", "look_up"};
constexpr std::string_view own_services = "ise.";

struct own_service {
    std::string_view name;
    action what;
};
// Services of ISE itself, by what they let somebody do. Of those that change something the component looks again, at
// what exactly.
constexpr own_service known_services[] = {
    {"ise.access", action::read},
    {"ise.calls", action::read},
    {"ise.change_parameters", action::set},
    {"ise.describe", action::read},
    {"ise.health", action::read},
    {"ise.host.change", action::start},
    {"ise.host.check", action::read},
    {"ise.host.events", action::read},
    {"ise.host.instances", action::read},
    {"ise.host.kill", action::stop},
    {"ise.host.output", action::read},
    {"ise.host.output_follow", action::read},
    {"ise.host.restart", action::start},
    {"ise.host.set", action::set},
    {"ise.host.start", action::start},
    {"ise.host.stop", action::stop},
    {"ise.host.types", action::read},
    {"ise.names.await", action::look_up},
    {"ise.names.describe", action::look_up},
    {"ise.names.ended", action::look_up},
    {"ise.names.list", action::look_up},
    {"ise.names.lost", action::look_up},
    {"ise.names.register", action::look_up},
    {"ise.names.renew", action::look_up},
    {"ise.names.resolve", action::look_up},
    {"ise.names.role", action::look_up},
    {"ise.names.watch", action::look_up},
    {"ise.names.withdraw", action::look_up},
    {"ise.parameter_changes", action::read},
    {"ise.parameters", action::read},
    {"ise.runs", action::read},
};

bool any_of(std::span<const std::string> texts, const pattern& of) noexcept {
    return std::ranges::any_of(texts, [&](const std::string& text) { return of.matches(text); });
}

// A wildcard never means what ISE itself provides: `atirma/boat:*` shall not let anybody set parameters.
bool means_item(const target& of, std::string_view item) noexcept {
    if (item.starts_with(own_services) && !of.item.text().starts_with(own_services)) return false;
    return of.item.matches(item);
}

std::optional<std::uint32_t> found(const std::vector<target>& all, const request& what) noexcept {
    for (const auto& one : all)
        if ((what.item.empty() || means_item(one, what.item)) && any_of(what.targets, one.path)) return one.line;
    return {};
}

std::optional<std::uint32_t> found(const std::vector<place>& all, const request& what) noexcept {
    for (const auto& one : all)
        if (any_of(what.targets, one.path)) return one.line;
    return {};
}

std::optional<std::uint32_t> found(const std::vector<role_grant>& all, const request& what, bool allows) noexcept {
    for (const auto& one : all)
        if (any_of(what.targets, one.role) && (!allows || !one.max_priority || what.priority <= *one.max_priority))
            return one.line;
    return {};
}

// An identity or a user of its own is allowed by a rule that names it only.
bool means_own(const std::optional<pattern>& of, std::string_view asked, bool allows) noexcept {
    if (!of) return !allows || asked.empty();
    return asked.empty() ? allows : of->matches(asked);
}

std::optional<std::uint32_t> found(const std::vector<host_grant>& all, const request& what, bool allows) noexcept {
    for (const auto& one : all) {
        if (!(what.what == action::start ? one.start : one.stop) || !one.host.matches(what.host)) continue;
        // Whether anything of the kind is allowed is asked first; a denial of some of it says nothing to that.
        if (what.any_path) {
            if (allows || (!one.type && !one.path && !one.identity && !one.user)) return one.line;
            continue;
        }
        if (one.type &&
            !(what.type.empty() ? one.type->text() == "*" || one.type->text() == "**" : one.type->matches(what.type)))
            continue;
        if (one.path && !any_of(what.targets, *one.path)) continue;
        if (!means_own(one.identity, what.identity, allows) || !means_own(one.user, what.user, allows)) continue;
        return one.line;
    }
    return {};
}

// The line at which a rule is about it.
std::optional<std::uint32_t> found(const rule& in, const request& what) noexcept {
    switch (what.what) {
        case action::call: return found(in.call, what);
        case action::subscribe: return found(in.subscribe, what);
        case action::read: return found(in.read, what);
        case action::name: return found(in.name, what);
        case action::role: return found(in.roles, what, in.allows);
        case action::set:
            // A denial of some parameters says nothing to whether any may be set.
            if (!in.allows && what.item.empty()) return {};
            if (what.any_path) return in.set.empty() ? std::nullopt : std::optional(in.set.front().line);
            return found(in.set, what);
        case action::start:
        case action::stop: return found(in.hosts, what, in.allows);
        case action::look_up: return in.allows ? std::optional(in.line) : std::nullopt;
    }
    return {};
}

} // namespace

std::string_view name_of(action what) noexcept { return action_names[static_cast<std::size_t>(what)]; }

result<action> parse_action(std::string_view text) {
    for (std::size_t at = 0; at < actions; ++at)
        if (text == action_names[at]) return static_cast<action>(at);
    return failure(errc::invalid_argument, fmt::format("'{}' is none of {}", text, fmt::join(action_names, ", ")));
}

std::string text_of(const request& what) {
    auto target = what.any_path ? std::string("*") : what.targets.empty() ? std::string() : what.targets.front();
    switch (what.what) {
        case action::call:
        case action::subscribe: return fmt::format("{} {}:{}", name_of(what.what), target, what.item);
        case action::set: return fmt::format("set {}:{}", target, what.item.empty() ? "*" : what.item);
        case action::role: return fmt::format("role {}={}", target, what.priority);
        case action::start:
        case action::stop:
            return fmt::format(
                "{} {}:{}{}{}{}{}{}{}", name_of(what.what), what.host, target, what.type.empty() ? "" : "=", what.type,
                what.identity.empty() ? "" : ",identity=", what.identity, what.user.empty() ? "" : ",user=", what.user);
        default: return fmt::format("{} {}", name_of(what.what), target);
    }
}

bool rule::means(std::string_view identity) const noexcept {
    return std::ranges::any_of(who, [&](const subject& one) {
        return identity.empty() ? one.nobody : !one.nobody && one.of.matches(identity);
    });
}

view::view(std::shared_ptr<const policy> of, std::string_view identity) : of_(std::move(of)) {
    for (const auto& one : of_->rules())
        if (one.means(identity)) (one.allows ? allow_ : deny_).push_back(&one);
}

verdict view::decide(const request& what) const noexcept {
    verdict made;
    for (const auto* one : deny_)
        if (auto line = found(*one, what)) {
            made.denied = true;
            made.line = *line;
            return made;
        }
    for (const auto* one : allow_)
        if (auto line = found(*one, what)) {
            made.allowed = true;
            made.line = *line;
            return made;
        }
    return made;
}

std::string_view policy::identity_of_user(std::uint32_t user) const noexcept {
    auto known = users_.find(user);
    return known == users_.end() ? std::string_view() : std::string_view(known->second);
}

bool policy::audited(std::span<const std::string> targets, std::string_view service) const noexcept {
    return std::ranges::any_of(
        audited_, [&](const target& one) { return means_item(one, service) && any_of(targets, one.path); });
}

verdict policy::decide(std::string_view identity, const request& what) const {
    // The rules of an identity that is asked about once need not be kept.
    std::shared_ptr<const policy> borrowed(std::shared_ptr<void>(), this);
    return view(std::move(borrowed), identity).decide(what);
}

request request_for(bool subscription, std::span<const std::string> targets, std::string_view service) noexcept {
    request made;
    made.targets = targets;
    made.item = service;
    made.what = subscription ? action::subscribe : action::call;
    if (!service.starts_with(own_services)) return made;
    auto known = std::ranges::find(known_services, service, &own_service::name);
    if (known == std::end(known_services)) return made; // of a later version: it takes a rule that names it
    made.what = known->what;
    made.item = {};
    made.any_path = service.starts_with("ise.host.");
    if (made.what == action::start || made.what == action::stop) {
        if (!targets.empty()) {
            std::string_view path = targets.front(); // ise/host/shore
            made.host = path.substr(path.rfind('/') + 1);
        }
    }
    return made;
}

std::string identity_of(const verified_peer& peer, const std::string& own, const policy* by) {
    if (peer.same_process) return own;
    if (!peer.certificate.empty()) return peer.certificate;
    if (by && peer.user)
        if (auto mapped = by->identity_of_user(*peer.user); !mapped.empty()) return std::string(mapped);
    if (peer.has_key) {
        if (by && !by->system().empty()) return fmt::format("ise://{}/key", by->system());
        auto mine = std::string_view(own).substr(0, 6) == "ise://" ? std::string_view(own).substr(6) : "";
        mine = mine.substr(0, mine.find('/'));
        return fmt::format("ise://{}/key", mine.empty() ? "system" : mine);
    }
    if (peer.user) return fmt::format("unix:{}", *peer.user);
    return {};
}

std::string_view shown(std::string_view identity) noexcept { return identity.empty() ? "nobody" : identity; }

result<void> check_identity(std::string_view text) {
    constexpr std::size_t most = 200;
    auto wrong = [&](std::string_view why) {
        std::string readable(text.substr(0, most));
        std::ranges::replace_if(
            readable, [](unsigned char letter) { return letter < 0x20 || letter >= 0x7f; }, '?');
        return failure(errc::invalid_argument,
                       fmt::format("'{}' is not an identity ({}): write it like ise://atirma/shore", readable, why));
    };
    constexpr std::string_view scheme = "ise://";
    if (!text.starts_with(scheme)) return wrong("it does not begin with ise://");
    if (text.size() > most) return wrong(fmt::format("it has {} bytes, {} are allowed", text.size(), most));
    std::size_t segments = 0, length = 0;
    for (char letter : text.substr(scheme.size())) {
        if (letter == '/') {
            if (length == 0) return wrong("a segment of it is empty");
            ++segments;
            length = 0;
            continue;
        }
        bool good = (letter >= 'a' && letter <= 'z') || (letter >= 'A' && letter <= 'Z') ||
                    (letter >= '0' && letter <= '9') || letter == '_' || letter == '.' || letter == '-' ||
                    letter == '@';
        if (!good) return wrong("it has letters, digits, '_', '.', '-' and '@' between its '/'");
        ++length;
    }
    if (length == 0 || segments == 0) return wrong("it has a system and a name");
    return {};
}

} // namespace ise::access
