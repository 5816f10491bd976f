#pragma once
#include <ise/core/result.hpp>
#include <ise/core/task.hpp>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace ise {

class listener;
class loop;
class stream;
struct endpoint;
struct security;

/// What follows `scheme://` in an endpoint.
enum class address_form : std::uint8_t {
    host_and_port, ///< `boat.local:7400`, `[::1]:0`; port 0: any free one
    file_or_name,  ///< a file of at most 107 bytes (a sockaddr_un has no more), or `@name`
    name,          ///< any text
};

/// A row of the table of transports: what is known of a scheme, and how streams over it are made. Everything that
/// depends on the kind of an endpoint asks its row (`at.kind->lossy`), when a session is made; calls and packets do
/// not.
///
/// The rows of ISE are listed in `ise/transport/table.cpp`; `add_transport` adds those of a program. A row is constant
/// and lives as long as the program.
struct transport {
    std::string_view scheme;  ///< "tcp": lower-case letters, digits, `+`, `.`, `-`
    std::string_view example; ///< of an endpoint, for error messages
    address_form address = address_form::host_and_port;
    /// Of the endpoints of one component, peers connect to the lowest rank that reaches it.
    std::uint8_t rank = 100;

    bool lossy = false;              ///< packets may be lost; calls are repeated by their number on the next session
    bool same_host = false;          ///< never leaves the host (loopback addresses are recognized by `within_host`)
    bool same_process = false;       ///< never leaves the process; implies `same_host`
    bool encrypted = false;          ///< both ends are authenticated, and nobody between them can read or change bytes
    bool needs_certificates = false; ///< listens and connects only with `security::tls`
    bool needs_descriptors = true;   ///< a session holds a file descriptor of its own at its provider
    bool by_default = false;         ///< components listen on it unless their endpoints are given

    /// Connects. Errors: errc::unreachable; errc::unauthorized or errc::invalid_argument where `with` does not suffice.
    /// No deadline of its own. Cancellation: terminal, nothing stays open. Runs on `on`, which outlives the stream.
    task<result<std::unique_ptr<stream>>> (*connect)(loop& on, endpoint to, security with) = nullptr;
    /// Listens. Errors: errc::address_in_use, errc::invalid_argument, errc::io_failed, and as `connect` for `with`.
    result<std::unique_ptr<listener>> (*listen)(loop& on, const endpoint& at, security with) = nullptr;
};

/// The kind of an endpoint: a row of the table. Two are equal if they are the same row; they are ordered by scheme.
class protocol {
public:
    static const protocol tcp, udp, tls, local, inproc; ///< rows of ISE that other code names

    constexpr protocol(const transport& row) noexcept : row_(&row) {}
    constexpr const transport* operator->() const noexcept { return row_; }
    constexpr const transport& operator*() const noexcept { return *row_; }

    friend constexpr bool operator==(protocol, protocol) noexcept = default;
    friend constexpr auto operator<=>(protocol one, protocol other) noexcept {
        return one.row_->scheme <=> other.row_->scheme;
    }

private:
    const transport* row_;
};

namespace transports {
extern const transport tcp, udp, tls, local, inproc; // ise/transport/*/transport.cpp
}
inline constexpr protocol protocol::tcp{transports::tcp};
inline constexpr protocol protocol::udp{transports::udp};
inline constexpr protocol protocol::tls{transports::tls};
inline constexpr protocol protocol::local{transports::local};
inline constexpr protocol protocol::inproc{transports::inproc};

/// Its scheme, such as "tcp".
inline std::string_view name_of(protocol kind) noexcept { return kind->scheme; }

/// The rows of ISE. Defined in `ise/transport/table.cpp`: rows know how streams are made, which the core does not.
std::span<const transport* const> built_in_transports() noexcept;
/// The rows of ISE, then those that were added. Thread-safe.
std::vector<protocol> all_transports();
/// The row of a scheme; null: there is none. Thread-safe.
const transport* find_transport(std::string_view scheme) noexcept;
/// The row of a text that begins with `scheme://`, such as the name of a peer; null: there is none. Thread-safe.
const transport* transport_of(std::string_view text) noexcept;
/// The schemes of those that lead to other processes, for options and errors.
/// Thread-safe.
std::vector<std::string> schemes_between_processes();

/// Adds a row, before any endpoint of it is parsed. Throws std::logic_error if the scheme is there already, or if 16
/// rows were added. Thread-safe. Lifetime: `row` lives as long as the program.
void add_transport(const transport& row);

} // namespace ise
