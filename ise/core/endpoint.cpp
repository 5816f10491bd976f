#include <ise/core/endpoint.hpp>

#include <fmt/format.h>

#include <charconv>

namespace ise {
namespace {

failure bad_endpoint(std::string_view text, std::string_view why) {
    std::string examples;
    for (auto one : all_transports()) examples += fmt::format("{}{}", examples.empty() ? "" : ", ", one->example);
    return {errc::invalid_argument, fmt::format("'{}' is not an endpoint: {}; write one like {}", text, why, examples)};
}

// The longest path that a sockaddr_un takes.
constexpr std::size_t max_local_path = 107;

} // namespace

std::string endpoint::text() const {
    if (!has_port()) return fmt::format("{}://{}", kind->scheme, path);
    bool v6 = host.find(':') != std::string::npos;
    return fmt::format("{}://{}{}{}:{}", kind->scheme, v6 ? "[" : "", host, v6 ? "]" : "", port);
}

result<endpoint> endpoint::parse(std::string_view text) {
    auto scheme_end = text.find("://");
    if (scheme_end == std::string_view::npos) return bad_endpoint(text, "it has no scheme");
    auto scheme = text.substr(0, scheme_end);
    auto rest = text.substr(scheme_end + 3);
    const auto* row = find_transport(scheme);
    if (!row) return bad_endpoint(text, fmt::format("there is no scheme '{}'", scheme));
    endpoint made;
    made.kind = *row;
    if (!made.has_port()) {
        const bool file = row->address == address_form::file_or_name;
        if (rest.empty() || (file && rest == "@")) return bad_endpoint(text, "the name is empty");
        if (rest.find('\0') != std::string_view::npos) return bad_endpoint(text, "the name holds a NUL");
        if (file && rest.size() > max_local_path)
            return bad_endpoint(text, fmt::format("a local path has at most {} bytes", max_local_path));
        made.path = rest;
        return made;
    }

    std::string_view port;
    if (rest.starts_with('[')) {
        auto close = rest.find(']');
        if (close == std::string_view::npos || rest.substr(close + 1, 1) != ":")
            return bad_endpoint(text, "an IPv6 address is written [address]:port");
        made.host = rest.substr(1, close - 1);
        port = rest.substr(close + 2);
    } else {
        auto colon = rest.find(':');
        if (colon == std::string_view::npos) return bad_endpoint(text, "the port is missing");
        if (rest.find(':', colon + 1) != std::string_view::npos)
            return bad_endpoint(text, "an IPv6 address is written [address]:port");
        made.host = rest.substr(0, colon);
        port = rest.substr(colon + 1);
    }
    if (made.host.empty()) return bad_endpoint(text, "the host is empty");
    auto [end, problem] = std::from_chars(port.data(), port.data() + port.size(), made.port);
    if (problem != std::errc{} || end != port.data() + port.size() || port.empty())
        return bad_endpoint(text, "the port is not a number from 0 to 65535");
    return made;
}

endpoint endpoint::any_of(protocol kind, const std::string& unique) {
    endpoint made;
    made.kind = kind;
    if (made.has_port()) made.host = "127.0.0.1";
    else made.path = kind->address == address_form::file_or_name ? "@" + unique : unique;
    return made;
}

bool within_host(const endpoint& at) noexcept {
    if (at.kind->same_host || at.host == "localhost" || at.host == "::1") return true;
    // 127.evil.example is a name, and anybody's.
    return at.host.starts_with("127.") && at.host.find_first_not_of("0123456789.") == std::string::npos;
}

} // namespace ise
