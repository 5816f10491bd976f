#include <ise/instantiation/launch_rules.hpp>

#include <ise/core/url.hpp>
#include <ise/instantiation/words.hpp>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

namespace ise::instantiation {
namespace {

failure not_allowed(std::string why) { return {errc::invalid_argument, std::move(why)}; }

// Lexically: what lies in an allowed folder is its owner's affair.
bool lies_in(std::string_view path, std::string_view folder) {
    while (folder.size() > 1 && folder.ends_with('/')) folder.remove_suffix(1);
    if (path.find("/../") != std::string_view::npos || path.ends_with("/..") || !path.starts_with('/')) return false;
    return path == folder || folder == "/" ||
           (path.starts_with(folder) && path.size() > folder.size() && path[folder.size()] == '/');
}

result<void> may_name_path(const launch_rules& rules, const std::string& path) {
    for (const auto& folder : rules.path_folders)
        if (lies_in(path, folder)) return {};
    return not_allowed(fmt::format("it must be a path below {} (--allow-path)",
                                   rules.path_folders.empty()
                                       ? "a folder that this instantiation server allows, and it allows none"
                                       : fmt::format("{}", fmt::join(rules.path_folders, " or "))));
}

result<void> may_listen_at(const launch_rules& rules, const std::string& address) {
    if (std::ranges::find(rules.listen_addresses, address) != rules.listen_addresses.end()) return {};
    return not_allowed(fmt::format("the addresses that this instantiation server allows are {} (--allow-address)",
                                   fmt::join(rules.listen_addresses, ", ")));
}

std::string host_text(const url_parts& of) {
    return of.host.find(':') == std::string::npos ? of.host : fmt::format("[{}]", of.host);
}

result<void> may_reach(const launch_rules& rules, const url_parts& who) {
    for (const auto& allowed : rules.target_hosts) {
        auto entry = parse_url("host://" + allowed);
        if (!entry) entry = parse_url("host://[" + allowed + "]"); // an IPv6 address without brackets
        if (entry && !who.host.empty() && entry->host == who.host && (entry->port == 0 || entry->port == who.port))
            return {};
    }
    if (who.host.empty())
        return not_allowed(
            fmt::format("{}:// reaches files or sockets of this host, which clients may not choose", who.scheme));
    auto there =
        rules.target_hosts.empty() ? std::string("none") : fmt::format("{}", fmt::join(rules.target_hosts, ", "));
    return not_allowed(
        fmt::format("this instantiation server allows parameters to name these hosts: {} (--allow-host {}{})", there,
                    host_text(who), who.port == 0 ? "" : fmt::format(":{}", who.port)));
}

result<void> may_reach_all(const launch_rules& rules, const std::string& text) {
    auto targets = urls_in(text);
    if (!targets) return targets.error();
    for (const auto& one : *targets) {
        auto may = may_reach(rules, one);
        if (!may) return may;
        for (const auto& file : one.files)
            if (auto named = may_name_path(rules, file); !named)
                return not_allowed(
                    fmt::format("the file '{}' in it is not allowed: {}", shown(file), named.error().message()));
    }
    return {};
}

} // namespace

result<endpoint> launch_rules::may_listen(const std::string& text) const {
    auto at = endpoint::parse(text);
    if (!at) return at;
    if (at->kind->same_process)
        return not_allowed(fmt::format("'{}' is reached only within its own process", shown(text)));
    if (at->kind->needs_certificates && !has_certificates)
        return not_allowed(
            fmt::format("{} takes certificates, and this instantiation server has none to pass on: it is "
                        "started with --tls FOLDER, or ISE_TLS",
                        at->kind->scheme));
    if (!at->has_port()) {
        // A file anywhere on this host is not for others to make.
        const bool may_be_file = at->kind->address == address_form::file_or_name;
        std::string_view name = at->path;
        bool plain = !may_be_file || name.starts_with('@');
        if (may_be_file && plain) name.remove_prefix(1);
        if (plain && is_word(name)) return at;
        return not_allowed(
            fmt::format("'{0}' cannot be listened on: {1} endpoints are {1}://{2}name here, with letters, "
                        "digits, - and _",
                        shown(text), at->kind->scheme, may_be_file ? "@" : ""));
    }
    auto may = may_listen_at(*this, at->host);
    if (!may) return not_allowed(fmt::format("'{}' cannot be listened on: {}", shown(text), may.error().message()));
    return at;
}

result<void> launch_rules::may_probe(const endpoint& at, const std::vector<endpoint>& listen) const {
    auto is_there = [&](const endpoint& one) {
        bool every_address = one.host == "0.0.0.0" || one.host == "::";
        return one.has_port() && !one.kind->lossy && one.port == at.port && (every_address || one.host == at.host);
    };
    if (may_listen_at(*this, at.host) && std::ranges::any_of(listen, is_there)) return {};
    url_parts who;
    who.scheme = "tcp";
    who.host = at.host;
    who.port = at.port;
    auto may = may_reach(*this, who);
    if (may) return {};
    return not_allowed(
        fmt::format("the component does not listen there by `listen` or a parameter: {}", may.error().message()));
}

result<void> launch_rules::may_be(const parameter& of, const std::string& value) const {
    if (value.empty()) return {};
    result<void> may;
    switch (of.kind) {
        case parameter_kind::path: may = may_name_path(*this, value); break;
        case parameter_kind::address: may = may_listen_at(*this, value); break;
        case parameter_kind::url:
        case parameter_kind::text: may = may_reach_all(*this, value); break;
        case parameter_kind::endpoint: {
            auto at = may_listen(value);
            if (!at) may = at.error();
            break;
        }
        case parameter_kind::integer:
        case parameter_kind::number:
        case parameter_kind::boolean:
        case parameter_kind::hexadecimal: break;
    }
    if (may) return {};
    return not_allowed(fmt::format("parameter '{}' cannot be '{}': {}", of.name, shown(value), may.error().message()));
}

} // namespace ise::instantiation
