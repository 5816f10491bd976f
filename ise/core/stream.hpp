#pragma once
#include <ise/core/asio_names.hpp>
#include <ise/core/bytes.hpp>
#include <ise/core/endpoint.hpp>
#include <ise/core/error.hpp>
#include <ise/core/task.hpp>

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <system_error>

namespace ise {

/// The result of a read or a write: the bytes transferred, and the error if there was one.
struct transfer {
    std::error_code problem; ///< empty on success
    std::size_t bytes = 0;   ///< transferred before that; of a write, perhaps as far as the peer
};

/// Takes the bytes of a stream as they arrive, without a coroutine that waits for them.
class stream_reader {
public:
    /// A stream that has delivered this much lets its turn end: what came is worked off, and answered, while it is in
    /// the processor's cache.
    static constexpr std::size_t turn_bytes = 256 * 1024;

    /// Memory for the next bytes. Empty: it takes no more.
    virtual asio::mutable_buffer room() noexcept = 0;
    /// They are in it; or the end of the stream or its error, at which the reader closes it. Called inside a turn of
    /// the loop. Does not destroy the stream.
    virtual void on_bytes(const transfer& got) = 0;

protected:
    ~stream_reader() = default;
};

/// A reliable byte stream: tcp, local, in-process, a serial line, or a virtual equivalent. Used on one loop.
///
/// At most one read and one wait for writability may be pending. Destroying or closing it completes them with
/// `asio::error::operation_aborted`; the object may be destroyed once they have completed.
class stream {
public:
    virtual ~stream() = default;

    /// Waits for at least one byte. End of stream is `asio::error::eof`. Cancellation: terminal, no data are lost.
    virtual task<transfer> read_some(asio::mutable_buffer into) = 0;

    /// From now on `reader`, which lives as long as the stream is open, gets what arrives, and the end. Called inside a
    /// turn of the loop, and never delivers within the call. False: this stream is read by `read_some`; it may use
    /// `reader` while that waits.
    virtual bool deliver_to([[maybe_unused]] stream_reader& reader) { return false; }

    /// Writes as much as possible without waiting: `would_block` if that is nothing. Other errors may follow `bytes`.
    virtual transfer try_write(std::span<const asio::const_buffer> from) = 0;

    /// Waits until `try_write` can write, or returns the error of the stream. Cancellation: terminal, ends only the
    /// wait.
    virtual task<std::error_code> wait_writable() = 0;

    /// Limits the unsent bytes: from now on writing blocks while this many wait in the system (tcp), or are in
    /// flight (udp).
    virtual void limit_unsent([[maybe_unused]] std::size_t most) {}

    /// Ends writing; the peer reads the remaining data and then the end of the stream.
    virtual void shutdown_write() = 0;
    /// Closes both directions at once; pending operations complete with `operation_aborted`.
    virtual void close() = 0;

    /// The peer, for people: "tcp://127.0.0.1:40112".
    virtual std::string peer() const = 0;
    /// The endpoint of this side to which the peer connected; empty if it is that of the listener.
    virtual std::optional<endpoint> local() const { return std::nullopt; }
    /// Why the transport itself refuses the peer or is refused by it: credentials, or no TLS. Empty: nothing is wrong.
    virtual std::optional<failure> verdict() const { return std::nullopt; }
};

/// Accepts streams on one endpoint. Destroying it stops listening and removes a local socket's file.
class listener {
public:
    virtual ~listener() = default;

    /// Waits for the next stream, for use on the listener's loop. After errors such as a lack of file descriptors
    /// `accept` may be called again; `asio::error::operation_aborted` after `close`. Cancellation:
    /// terminal; a stream that arrives later waits for the next `accept`.
    virtual task<std::pair<std::error_code, std::unique_ptr<stream>>> accept() = 0;
    /// Stops listening.
    virtual void close() = 0;

    /// The endpoint on which it listens, with the actual port for port 0.
    virtual endpoint where() const = 0;
};

/// A received datagram.
struct datagram {
    endpoint peer; ///< the sender
    bytes content; ///< the whole datagram
};

/// Takes the datagrams of a socket as they arrive, without a coroutine that waits for them. Called inside a turn of the
/// loop. May close the socket; does not destroy it.
class datagram_reader {
public:
    /// Both are valid during the call.
    virtual void on_datagram(const endpoint& from, bytes_view content) = 0;
    /// The system reported an error. Datagrams may still come.
    virtual void on_problem(const std::error_code& why) = 0;

protected:
    ~datagram_reader() = default;
};

/// A socket for unreliable datagrams. Used on one loop; at most one receive may be pending.
class datagram_socket {
public:
    virtual ~datagram_socket() = default;
    /// From now on `reader`, which lives as long as the socket is open, gets what arrives, and `receive` is not used.
    /// Datagrams of more than `max_bytes` are dropped. Never delivers within the call.
    virtual void deliver_to(datagram_reader& reader, std::size_t max_bytes) = 0;
    /// Waits for the next datagram, which the socket owns: it is valid until the next call, or the end of the socket.
    /// Cancellation: terminal, no data are lost. Errors: `operation_aborted` after `close`, else those of the system.
    virtual task<std::pair<std::error_code, const datagram*>> receive() = 0;
    /// Sends or drops; `asio::error::would_block` when the kernel has no room.
    virtual std::error_code try_send(const endpoint& to, bytes_view content) = 0;
    /// Closes it; a pending receive completes with `operation_aborted`.
    virtual void close() = 0;
    /// The endpoint to which it is bound, with the actual port.
    virtual endpoint where() const = 0;
};

} // namespace ise
