#pragma once
#include <ise/core/real/descriptor.hpp>
#include <ise/core/real/system_sockets.hpp>
#include <ise/core/stream.hpp>
#include <ise/core/verified_peer.hpp>
#include <ise/core/waiter.hpp>

#include <asio/buffer.hpp>

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace ise::real {

/// A connected stream socket, tcp or local.
class socket_stream final : public stream, public verified_stream, private descriptor {
public:
    socket_stream(loop& on, owned_fd fd, std::string peer);
    ~socket_stream() override { close(); }

    using descriptor::fd;
    /// Descriptors that the peer passes over a local socket are added to `into` by the reads that follow; null: they
    /// are dropped again. Lifetime: `into` until the next call.
    void keep_passed(std::vector<owned_fd>* into) noexcept { passed_ = into; }

    /// A stream over a socket that is connected.
    static std::pair<std::error_code, std::unique_ptr<stream>> of(loop& on, owned_fd connected, std::string peer);
    /// Connects a new socket to an address. Errors: those of the system. Cancellation: terminal, `operation_aborted`,
    /// and nothing stays open.
    static task<std::pair<std::error_code, std::unique_ptr<stream>>> connect(loop& on, sockaddr_storage to,
                                                                             socklen_t size, std::string peer);

    task<transfer> read_some(asio::mutable_buffer into) override;
    bool deliver_to(stream_reader& reader) override;
    transfer try_write(std::span<const asio::const_buffer> from) override;
    task<std::error_code> wait_writable() override;
    void limit_unsent(std::size_t most) override;
    void shutdown_write() override;
    void close() override;
    std::string peer() const override { return peer_; }
    void add_verified(verified_peer& to) const override;
    std::optional<endpoint> local() const override;

private:
    struct outcome {
        std::error_code problem;
    };

    transfer read(asio::mutable_buffer into);
    void on_readable() override;
    void on_received(const received& what) override;
    void on_receive_failure(const std::error_code& problem) override;
    void deliver();
    void on_writable() override { writable_.resume({}); }

    std::string peer_;
    std::vector<owned_fd>* passed_ = nullptr;
    stream_reader* deliver_to_ = nullptr;
    asio::mutable_buffer into_; // of the read that waits
    waiter<transfer> reader_;
    waiter<outcome> writable_;
};

/// Accepts connections on a socket that listens.
class socket_acceptor : private descriptor {
public:
    using accepted = std::pair<std::error_code, owned_fd>;

    socket_acceptor(loop& on, owned_fd listening);
    ~socket_acceptor() { close(); }

    using descriptor::watch;
    /// As `listener::accept`. Errors: those of the system, and it may be called again; `operation_aborted` after
    /// `close`. Cancellation: terminal; who comes later waits for the next `accept`.
    task<accepted> accept();
    void close() noexcept;

private:
    accepted take();
    void on_readable() override;
    void on_writable() override {}

    waiter<accepted> waiting_;
};

} // namespace ise::real
