#pragma once
#include <ise/core/bytes.hpp>
#include <ise/core/endpoint.hpp>
#include <ise/core/task.hpp>

#include <asio/buffer.hpp>

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <system_error>

namespace ise {

/// How a read or a write went: what was moved, and the error if there was one.
struct transfer {
    std::error_code problem; ///< none: it went well
    std::size_t bytes = 0; ///< moved before that
};

/// A reliable byte stream: tcp, local, in-process, a serial line, or their virtual twins. Used on one loop.
///
/// At most one read and one wait for writability are in flight. Destroying or closing it completes them with
/// `asio::error::operation_aborted`; the object may be destroyed once they have completed.
class stream {
public:
    virtual ~stream() = default;

    /// Waits for at least one byte. End of stream is `asio::error::eof`. Cancellation: terminal, nothing is lost.
    virtual task<transfer> read_some(asio::mutable_buffer into) = 0;

    /// Writes what goes at once and never waits: `asio::error::would_block` when nothing does.
    virtual transfer try_write(std::span<const asio::const_buffer> from) = 0;

    /// Waits until `try_write` would move something, or reports what broke.
    virtual task<std::error_code> wait_writable() = 0;

    /// From now on it takes no more while this many bytes wait to be sent, where the system can tell (tcp); over udp
    /// while they are under way.
    virtual void limit_unsent([[maybe_unused]] std::size_t most) {}

    /// No more will be written; the peer reads the rest and then the end.
    virtual void shutdown_write() = 0;
    /// Both ways, at once; what waits completes with `operation_aborted`.
    virtual void close() = 0;

    /// The other side, for people: "tcp://127.0.0.1:40112".
    virtual std::string peer() const = 0;
    /// The endpoint of this side that the peer connected to; nothing where that is what its listener says.
    virtual std::optional<endpoint> local() const { return std::nullopt; }
};

/// Accepts streams on one endpoint. Destroying it stops listening and removes a local socket's file.
class listener {
public:
    virtual ~listener() = default;

    /// The next stream, for use on the listener's loop. Out of file descriptors and the like are errors after
    /// which `accept` may be called again; `asio::error::operation_aborted` after `close`.
    virtual task<std::pair<std::error_code, std::unique_ptr<stream>>> accept() = 0;
    /// Stops listening.
    virtual void close() = 0;

    /// Where it listens, with the port that was given for port 0.
    virtual endpoint where() const = 0;
};

/// One datagram, as it came.
struct datagram {
    endpoint peer; ///< who sent it
    bytes content; ///< all of it
};

/// Unreliable datagrams. Used on one loop; one receive in flight.
class datagram_socket {
public:
    virtual ~datagram_socket() = default;
    /// The next datagram, which is the socket's own: it is there until the next call, or the socket's end.
    /// Cancellation: terminal, nothing is lost. `operation_aborted` after `close`.
    virtual task<std::pair<std::error_code, const datagram*>> receive() = 0;
    /// Sends or drops; `asio::error::would_block` when the kernel has no room.
    virtual std::error_code try_send(const endpoint& to, bytes_view content) = 0;
    /// Ends it; a receive that waits completes with `operation_aborted`.
    virtual void close() = 0;
    /// The endpoint that it is bound to, with the real port.
    virtual endpoint where() const = 0;
};

} // namespace ise
