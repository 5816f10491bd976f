#pragma once
#include <ise/core/result.hpp>
#include <ise/core/transport.hpp>

#include <compare>
#include <cstdint>
#include <string>
#include <string_view>

namespace ise {

/// The address at which a component listens, as users write it:
/// `tcp://127.0.0.1:7400`, `tcp://[::1]:0`, `udp://…`, `tls://boat.local:7400`, `local:///run/ise/boat.sock`,
/// `local://@abstract`, `inproc://name`. Port 0 asks for any free port.
struct endpoint {
    protocol kind = protocol::tcp; ///< its row in the table of transports
    std::string host;              ///< address_form::host_and_port: a name or an address, IPv6 without brackets
    std::uint16_t port = 0;        ///< address_form::host_and_port
    std::string path;              ///< the other forms: file, `@name` or name

    /// Compares the kind, then the fields; names are not resolved.
    auto operator<=>(const endpoint&) const = default;

    /// Whether `host` and `port` are used, else `path`.
    bool has_port() const noexcept { return kind->address == address_form::host_and_port; }
    /// The text that `parse` reads.
    std::string text() const;

    /// Fails with errc::invalid_argument, with the cause and an example.
    static result<endpoint> parse(std::string_view text);
    /// An endpoint of this host that nothing else uses: any port of loopback, or the name `unique`.
    static endpoint any_of(protocol kind, const std::string& unique);
};

/// Whether a listener there cannot be reached from other hosts: loopback, local and in-process endpoints. The only host
/// name that counts is `localhost`.
bool within_host(const endpoint& at) noexcept;

} // namespace ise
