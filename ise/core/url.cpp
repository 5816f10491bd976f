#include <ise/core/url.hpp>

#include <ise/core/transport.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <iterator>
#include <optional>
#include <utility>

namespace ise {
namespace {

failure no_url(std::string_view text, std::string_view why) {
    return {errc::invalid_argument,
            fmt::format("'{}' is not a URL: {}; write https://host/path or tcp://host:7411", text.substr(0, 200), why)};
}

bool is_letter(char one) { return (one >= 'a' && one <= 'z') || (one >= 'A' && one <= 'Z'); }
bool is_digit(char one) { return one >= '0' && one <= '9'; }
bool is_of_scheme(char one) { return is_letter(one) || is_digit(one) || one == '+' || one == '.' || one == '-'; }
bool is_of_host(char one) { return is_letter(one) || is_digit(one) || one == '.' || one == '-' || one == '_'; }
bool is_of_v6(char one) {
    return is_digit(one) || (one >= 'a' && one <= 'f') || (one >= 'A' && one <= 'F') || one == ':' || one == '.';
}

std::string lower(std::string_view text) {
    std::string made(text);
    for (char& one : made)
        if (one >= 'A' && one <= 'Z') one = static_cast<char>(one - 'A' + 'a');
    return made;
}

std::uint16_t usual_port(std::string_view scheme) {
    static constexpr std::pair<std::string_view, std::uint16_t> usual[] = {
        {"http", 80}, {"https", 443}, {"imap", 143},        {"imaps", 993},
        {"smtp", 25}, {"smtps", 465}, {"postgresql", 5432}, {"postgres", 5432}};
    for (const auto& [name, port] : usual)
        if (name == scheme) return port;
    return 0;
}

} // namespace

std::string url_parts::server() const {
    const bool v6 = host.find(':') != std::string::npos;
    auto made = fmt::format("{}://{}{}{}", scheme, v6 ? "[" : "", host, v6 ? "]" : "");
    return port == 0 ? made : fmt::format("{}:{}", made, port);
}

result<url_parts> parse_url(std::string_view text) {
    auto colon = text.find("://");
    if (colon == std::string_view::npos || colon == 0) return no_url(text, "it has no scheme");
    auto scheme = text.substr(0, colon);
    if (!is_letter(scheme.front()) || !std::ranges::all_of(scheme, is_of_scheme))
        return no_url(text, "its scheme is none");
    for (char one : text)
        if (static_cast<unsigned char>(one) <= 0x20 || one == 0x7F || one == '\\')
            return no_url(text, "it holds a blank, a control character or a backslash");
    url_parts made;
    made.scheme = lower(scheme);
    made.port = usual_port(made.scheme);
    const auto* sessions = find_transport(made.scheme);
    if (made.scheme == "file" || (sessions && sessions->address != address_form::host_and_port)) return made;
    auto rest = text.substr(colon + 3);
    auto authority = rest.substr(0, rest.find_first_of("/?#"));
    rest.remove_prefix(authority.size());
    made.target = rest.substr(0, rest.find('#'));
    if (authority.find('@') != std::string_view::npos) return no_url(text, "a user before the host is not allowed");
    std::string_view host, port;
    if (authority.starts_with('[')) {
        auto close = authority.find(']');
        if (close == std::string_view::npos) return no_url(text, "an IPv6 address is written [address]");
        host = authority.substr(1, close - 1);
        port = authority.substr(close + 1);
        if (!std::ranges::all_of(host, is_of_v6)) return no_url(text, "its host is not an IPv6 address");
    } else {
        host = authority.substr(0, authority.find(':'));
        port = authority.substr(host.size());
        if (!std::ranges::all_of(host, is_of_host)) return no_url(text, "its host is not a name or address");
    }
    if (host.empty()) return no_url(text, "the host is empty");
    if (!port.empty()) {
        auto digits = port.substr(1);
        auto [end, problem] = std::from_chars(digits.data(), digits.data() + digits.size(), made.port);
        if (port.front() != ':' || problem != std::errc() || end != digits.data() + digits.size())
            return no_url(text, "the port is not a number from 0 to 65535");
    }
    made.host = lower(host);
    return made;
}

namespace {
// Without a plain user name before the host, on which all readers of a URL agree.
std::string without_user(std::string_view url) {
    auto begin = url.find("://") + 3;
    auto user = url.substr(begin, url.find_first_of("@/?#", begin) - begin);
    bool plain = !user.empty() && begin + user.size() < url.size() && url[begin + user.size()] == '@' &&
                 std::ranges::all_of(user, is_of_host);
    return std::string(url.substr(0, begin)).append(url.substr(plain ? begin + user.size() + 1 : begin));
}

bool names_several_hosts(std::string_view url) {
    return url.starts_with("postgresql://") || url.starts_with("postgres://");
}

// Decodes %2F in a value as libpq does; nothing: libpq would refuse it.
std::optional<std::string> decoded(std::string_view value) {
    std::string made;
    for (std::size_t at = 0; at != value.size(); ++at) {
        if (value[at] != '%') {
            made += value[at];
            continue;
        }
        unsigned char byte = 0;
        const char* end = value.data() + std::min(at + 3, value.size());
        auto read = std::from_chars(value.data() + at + 1, end, byte, 16);
        if (at + 2 >= value.size() || read.ec != std::errc() || read.ptr != end || byte == 0) return std::nullopt;
        made += static_cast<char>(byte);
        at += 2;
    }
    return made;
}

// libpq's parameters that are read, written or searched as a file or folder, also those of later versions.
bool names_file(std::string_view key) {
    static constexpr std::string_view all[] = {"passfile", "sslkey",    "sslcert",       "sslrootcert",
                                               "sslcrl",   "sslcrldir", "sslkeylogfile", "servicefile"};
    return std::ranges::find(all, key) != std::end(all);
}

// Parameters that replace what is written before the database.
bool names_server(std::string_view key) {
    return key == "host" || key == "hostaddr" || key == "port" || key == "service";
}

// "postgresql://user@a:5432,b/database?sslmode=require": the servers that libpq would connect to. libpq lets parameters
// replace the hosts, takes all up to an "@" before the first "/" for a user, and knows no fragment.
result<std::vector<url_parts>> servers_of(std::string_view url) {
    auto plain = without_user(url);
    auto begin = plain.find("://") + 3;
    auto end = std::min(plain.find_first_of("/?#", begin), plain.size());
    auto rest = std::string_view(plain).substr(end);
    if (rest.substr(0, rest.find('/')).find('@') != rest.npos || rest.find('#') != rest.npos)
        return no_url(url, "a # or an @ follows its hosts");
    std::vector<std::string> files;
    for (auto words = rest.substr(std::min(rest.find('?'), rest.size())); !words.empty();) {
        words.remove_prefix(1);
        auto word = words.substr(0, words.find('&'));
        words.remove_prefix(word.size());
        auto key = word.substr(0, word.find('='));
        if (names_server(key) || key.find('%') != key.npos)
            return no_url(url, "hosts and ports are written before the database");
        if (!names_file(key)) continue;
        auto value = decoded(word.substr(std::min(key.size() + 1, word.size())));
        if (!value) return no_url(url, fmt::format("the value of {} is not one in a URL", key));
        if (!value->empty() && !(key == "sslrootcert" && *value == "system")) files.push_back(std::move(*value));
    }
    std::vector<url_parts> all;
    for (auto from = begin; from <= end;) {
        auto next = std::min(plain.find(',', from), end);
        auto one = parse_url(plain.substr(0, begin) + plain.substr(from, next - from) + std::string(rest));
        if (!one) return one.error();
        all.push_back(std::move(*one));
        from = next + 1;
    }
    all.front().files = std::move(files);
    return all;
}
} // namespace

result<std::vector<url_parts>> urls_in(std::string_view text) {
    std::vector<url_parts> all;
    for (auto at = text.find("://"); at != std::string_view::npos; at = text.find("://", at + 3)) {
        auto from = at;
        while (from > 0 && is_of_scheme(text[from - 1])) --from;
        if (names_several_hosts(text.substr(from))) {
            auto servers = servers_of(text.substr(from));
            if (!servers) return servers.error();
            std::ranges::move(*servers, std::back_inserter(all));
            continue;
        }
        auto one = text.substr(from, text.find_first_of(" \t,;\"'", at) - from);
        auto parsed = parse_url(without_user(one));
        if (!parsed) return parsed.error();
        all.push_back(std::move(*parsed));
    }
    return all;
}

} // namespace ise
