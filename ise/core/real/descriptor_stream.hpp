#pragma once
#include <ise/core/stream.hpp>

#include <asio/experimental/as_tuple.hpp>
#include <asio/use_awaitable.hpp>

#include <sys/socket.h>
#include <sys/uio.h>

#include <algorithm>
#include <cerrno>

namespace ise::real {

inline constexpr auto as_tuple = asio::experimental::as_tuple(asio::use_awaitable);

/// A stream over an Asio object that has `async_read_some`, `async_wait` and `native_handle`: a connected
/// socket or a serial port.
template <class Object>
class descriptor_stream final : public stream {
public:
    descriptor_stream(Object object, std::string peer) : object_(std::move(object)), peer_(std::move(peer)) {}

    task<transfer> read_some(asio::mutable_buffer into) override {
        auto [problem, count] = co_await object_.async_read_some(into, as_tuple);
        co_return transfer{problem, count};
    }

    transfer try_write(std::span<const asio::const_buffer> from) override {
        iovec pieces[64];
        std::size_t count = std::min(from.size(), std::size(pieces));
        for (std::size_t i = 0; i < count; ++i)
            pieces[i] = {const_cast<void*>(from[i].data()), from[i].size()};
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
