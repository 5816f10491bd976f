#pragma once
#include <ise/core/asio_compat.hpp>
#include <ise/core/stream.hpp>

#include <asio/buffer.hpp>

#include <sys/uio.h>

#include <algorithm>
#include <cerrno>

namespace ise::real {

/// A stream over an Asio object that has `async_read_some`, `async_wait` and `native_handle`: a serial port or a
/// pseudo-terminal.
template <class Object>
class descriptor_stream final : public stream {
public:
    descriptor_stream(Object object, std::string peer) : object_(std::move(object)), peer_(std::move(peer)) {}

    task<transfer> read_some(asio::mutable_buffer into) override {
        auto [problem, count] = co_await object_.async_read_some(into, compat::as_tuple);
        co_return transfer{problem, count};
    }

    transfer try_write(std::span<const asio::const_buffer> from) override {
        iovec pieces[64];
        std::size_t count = std::min(from.size(), std::size(pieces));
        for (std::size_t i = 0; i < count; ++i) pieces[i] = {const_cast<void*>(from[i].data()), from[i].size()};
        for (;;) {
            auto written = ::writev(object_.native_handle(), pieces, static_cast<int>(count));
            if (written >= 0) return {{}, static_cast<std::size_t>(written)};
            if (errno == EINTR) continue;
            if (errno == EAGAIN || errno == EWOULDBLOCK) return {asio::error::would_block, 0};
            return {std::error_code(errno, std::system_category()), 0};
        }
    }

    task<std::error_code> wait_writable() override {
        auto [problem] = co_await object_.async_wait(Object::wait_write, compat::as_tuple);
        co_return problem;
    }

    void shutdown_write() override {}
    void close() override {
        std::error_code ignored;
        object_.close(ignored);
    }
    std::string peer() const override { return peer_; }

private:
    Object object_;
    std::string peer_;
};

} // namespace ise::real
