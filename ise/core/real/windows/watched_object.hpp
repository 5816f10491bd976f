#pragma once
#include <asio/any_io_executor.hpp>
#include <asio/generic/datagram_protocol.hpp>
#include <asio/generic/stream_protocol.hpp>

#include <memory>
#include <optional>
#include <utility>

namespace ise::real {

/// A socket. Asio waits for the bytes of a connection with a completion port (an empty read), for all else with
/// `select` on a thread of its own: an empty read of a datagram would lose it, and one of a listening socket fails.
class watched_object {
public:
    using wait_type = asio::socket_base::wait_type;
    static constexpr auto wait_read = asio::socket_base::wait_read;
    static constexpr auto wait_write = asio::socket_base::wait_write;

    /// Throws std::system_error; the socket is the caller's then.
    watched_object(const asio::any_io_executor& on, int socket);

    template <class Handler>
    void async_wait(wait_type what, Handler then) {
        if (connection_ && what == wait_write && connecting_) await_connection(std::move(then));
        else if (connection_) connection_->async_wait(what, std::move(then));
        else other_->async_wait(what, std::move(then));
    }
    void close(std::error_code& problem);

private:
    using connection = asio::generic::stream_protocol::socket;

    // A connection that was refused never becomes writable: that is an error to `select`.
    template <class Handler>
    void await_connection(Handler then) {
        connecting_ = false;
        auto once = std::make_shared<std::optional<Handler>>(std::move(then));
        auto first = [this, once](std::error_code problem) {
            auto waiting = std::exchange(*once, std::nullopt);
            if (!waiting) return;
            std::error_code ignored;
            if (connection_->is_open()) connection_->cancel(ignored); // the other wait
            (*waiting)(problem);
        };
        connection_->async_wait(wait_write, first);
        connection_->async_wait(asio::socket_base::wait_error, first);
    }

    std::optional<connection> connection_;
    std::optional<asio::generic::datagram_protocol::socket> other_;
    bool connecting_ = false;
};

} // namespace ise::real
