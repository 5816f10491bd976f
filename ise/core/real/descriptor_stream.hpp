#pragma once
#include <ise/core/asio_compat.hpp>
#include <ise/core/stream.hpp>
#include <ise/core/verified_peer.hpp>

#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <sys/uio.h>

#include <algorithm>
#include <cerrno>

namespace ise::real {

using compat::as_tuple;

/// A stream over an Asio object that has `async_read_some`, `async_wait` and `native_handle`: a connected
/// socket or a serial port.
template <class Object>
class descriptor_stream final : public stream, public verified_stream {
public:
    descriptor_stream(Object object, std::string peer) : object_(std::move(object)), peer_(std::move(peer)) {}

    task<transfer> read_some(asio::mutable_buffer into) override {
        auto [problem, count] = co_await object_.async_read_some(into, as_tuple);
        co_return transfer{problem, count};
    }

    transfer try_write(std::span<const asio::const_buffer> from) override {
        iovec pieces[64];
        std::size_t count = std::min(from.size(), std::size(pieces));
        for (std::size_t i = 0; i < count; ++i) pieces[i] = {const_cast<void*>(from[i].data()), from[i].size()};
        for (;;) {
            auto written = write(pieces, count);
            if (written >= 0) return {{}, static_cast<std::size_t>(written)};
            if (errno == EINTR) continue;
            if (errno == EAGAIN || errno == EWOULDBLOCK) return {asio::error::would_block, 0};
            return {std::error_code(errno, std::system_category()), 0};
        }
    }

    task<std::error_code> wait_writable() override {
        auto [problem] = co_await object_.async_wait(Object::wait_write, as_tuple);
        co_return problem;
    }

    void limit_unsent(std::size_t most) override {
        if constexpr (is_socket) {
            auto bytes_waiting = static_cast<int>(std::clamp<std::size_t>(most, 1, 1u << 30));
            // A local socket has none.
            ::setsockopt(object_.native_handle(), IPPROTO_TCP, TCP_NOTSENT_LOWAT, &bytes_waiting, sizeof bytes_waiting);
        }
    }

    void shutdown_write() override {
        if constexpr (is_socket) {
            std::error_code ignored; // not connected any more: the reader learns it
            object_.shutdown(Object::shutdown_send, ignored);
        }
    }

    void close() override {
        std::error_code ignored;
        object_.close(ignored);
    }

    std::string peer() const override { return peer_; }
    // Of a local socket the system knows whose process made it.
    void add_verified([[maybe_unused]] verified_peer& to) const override {
        if constexpr (is_socket && !requires { object_.local_endpoint().address(); }) {
            ucred made{};
            socklen_t size = sizeof made;
            // The handle of an Asio object is asked for by a member that is not const.
            auto handle = const_cast<Object&>(object_).native_handle();
            if (::getsockopt(handle, SOL_SOCKET, SO_PEERCRED, &made, &size) == 0 && size == sizeof made)
                to.user = made.uid;
        }
    }
    std::optional<endpoint> local() const override {
        if constexpr (requires { object_.local_endpoint().address(); }) {
            std::error_code problem;
            auto here = object_.local_endpoint(problem);
            if (!problem) return endpoint{protocol::tcp, here.address().to_string(), here.port(), {}};
        }
        return std::nullopt;
    }

private:
    static constexpr bool is_socket = requires { Object::shutdown_send; };

    ssize_t write(iovec* pieces, std::size_t count) {
        if constexpr (is_socket) {
            msghdr message{};
            message.msg_iov = pieces;
            message.msg_iovlen = count;
            return ::sendmsg(object_.native_handle(), &message, MSG_NOSIGNAL | MSG_DONTWAIT);
        } else {
            return ::writev(object_.native_handle(), pieces, static_cast<int>(count));
        }
    }

    Object object_;
    std::string peer_;
};

} // namespace ise::real
