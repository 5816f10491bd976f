#pragma once
#include <ise/core/result.hpp>

#include <compare>
#include <cstdint>
#include <string>
#include <string_view>

namespace ise {

/// The kind of an endpoint: TCP, UDP, a Unix domain socket, memory within one process, or TLS over TCP.
enum class protocol : std::uint8_t { tcp, udp, local, inproc, tls };

/// "tcp", "udp", "local", "inproc", "tls".
std::string_view name_of(protocol kind) noexcept;

/// The address at which a component listens, as users write it:
/// `tcp://127.0.0.1:7400`, `tcp://[::1]:0`, `udp://…`, `tls://boat.local:7400`, `local:///run/ise/boat.sock`,
/// `local://@abstract`, `inproc://name`. Port 0 asks for any free port.
struct endpoint {
    protocol kind = protocol::tcp; ///< determines which of the fields below are used
    std::string host;              ///< tcp, udp, tls: a name or an address, IPv6 without brackets
    std::uint16_t port = 0;        ///< tcp, udp, tls
    std::string path;              ///< local: file or `@name`; inproc: name

    /// Compares the kind, then the fields; names are not resolved.
    auto operator<=>(const endpoint&) const = default;

    /// The text that `parse` reads.
    std::string text() const;

    /// Fails with errc::invalid_argument, with the cause and an example.
    static result<endpoint> parse(std::string_view text);
};

/// Whether a listener there cannot be reached from other hosts: loopback, local and in-process endpoints. The only host
/// name that counts is `localhost`.
bool within_host(const endpoint& at) noexcept;

} // namespace ise
