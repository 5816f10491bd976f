#pragma once
#include <ise/core/result.hpp>

#include <compare>
#include <cstdint>
#include <string>
#include <string_view>

namespace ise {

/// How an endpoint is reached: TCP, UDP, a Unix domain socket, memory within one process, or TLS over TCP.
enum class protocol : std::uint8_t { tcp, udp, local, inproc, tls };

/// "tcp", "udp", "local", "inproc", "tls".
std::string_view name_of(protocol kind) noexcept;

/// Where a component listens or is reached, as users write it:
/// `tcp://127.0.0.1:7400`, `tcp://[::1]:0`, `udp://…`, `tls://boat.local:7400`, `local:///run/ise/boat.sock`,
/// `local://@abstract`, `inproc://name`. Port 0 asks for any free port.
struct endpoint {
    protocol kind = protocol::tcp; ///< which of the fields below count
    std::string host;       ///< tcp, udp, tls: a name or an address, IPv6 without brackets
    std::uint16_t port = 0; ///< tcp, udp, tls
    std::string path;       ///< local: file or `@name`; inproc: name

    /// By kind, then by the fields; no names are resolved.
    auto operator<=>(const endpoint&) const = default;

    /// As `parse` reads it.
    std::string text() const;

    /// errc::invalid_argument says what is wrong and shows a right one.
    static result<endpoint> parse(std::string_view text);
};

/// Whether nobody on another host reaches a listener there: loopback, local and in-process endpoints. Of host names only
/// `localhost` counts.
bool within_host(const endpoint& at) noexcept;

} // namespace ise
