#include <ise/sim/machine.hpp>

#include <fmt/format.h>

namespace ise::sim {
namespace {

bool loopback(const std::string& host) { return host == "localhost" || host.starts_with("127.") || host == "::1"; }
bool wildcard(const std::string& host) { return host == "0.0.0.0" || host == "::"; }
bool v6(const std::string& host) { return host.find(':') != std::string::npos; }

} // namespace

bool machine::is_me(const std::string& other) const {
    return loopback(other) || wildcard(other) || other == name_ || other == address_;
}

std::uint16_t machine::ephemeral_port() {
    const auto port = next_port_;
    next_port_ = next_port_ == 65535 ? std::uint16_t{49152} : static_cast<std::uint16_t>(next_port_ + 1);
    return port;
}

// Where a listener or a datagram port is bound, given what is bound already.
result<void> machine::claim(endpoint& at, const endpoint& wanted, const std::vector<endpoint>& taken) {
    at = wanted;
    if (at.kind == protocol::local) {
        for (const auto& other : taken)
            if (other.kind == protocol::local && other.path == at.path)
                return failure(errc::address_in_use,
                               fmt::format("cannot listen on {}: address in use on host '{}'", at.text(), name_));
        return {};
    }
    if (at.host == "localhost") at.host = "127.0.0.1";
    if (at.host == name_) at.host = address_;
    if (!is_me(at.host))
        return failure(errc::io_failed, fmt::format("cannot listen on {}: host '{}' has no such address, it has {}",
                                                    at.text(), name_, address_));
    auto conflicts = [&](std::uint16_t port) {
        for (const auto& other : taken)
            if (other.kind == at.kind && other.port == port &&
                (other.host == at.host ||
                 (v6(other.host) == v6(at.host) && (wildcard(other.host) || wildcard(at.host)))))
                return true;
        return false;
    };
    if (at.port != 0) {
        if (conflicts(at.port))
            return failure(errc::address_in_use,
                           fmt::format("cannot listen on {}: address in use on host '{}'", at.text(), name_));
        return {};
    }
    for (int tries = 0; tries < 16384; ++tries) {
        at.port = ephemeral_port();
        if (!conflicts(at.port)) return {};
    }
    return failure(errc::address_in_use,
                   fmt::format("cannot listen on {}: no free port on host '{}'", wanted.text(), name_));
}

bool machine::hears(const endpoint& at, const endpoint& to) const {
    if (at.port != to.port) return false;
    const auto host = to.host == "localhost" ? std::string("127.0.0.1") : to.host;
    if (wildcard(at.host)) return v6(at.host) == v6(host);
    return at.host == (host == name_ ? address_ : host);
}

} // namespace ise::sim
