#pragma once
// environment-boundary: RESTinio owns its sockets, and these are they
#include <asio/io_context.hpp>
#include <asio/ip/tcp.hpp>

#include <cstddef>
#include <memory>
#include <set>
#include <system_error>

// The sockets of the HTTP server, which it closes itself.
namespace atirma {

/// RESTinio leaves its connections open when it stops, so the server keeps track of its sockets itself.
struct socket_registry {
    std::set<asio::ip::tcp::socket*> sockets;

    std::size_t open() const noexcept {
        std::size_t count = 0;
        for (const auto* socket : sockets) count += socket->is_open() ? 1 : 0;
        return count;
    }
    void close_all() noexcept {
        for (auto* socket : sockets) {
            std::error_code ignored;
            socket->shutdown(asio::ip::tcp::socket::shutdown_both, ignored);
            socket->close(ignored);
        }
    }
};

/// A socket that enters itself in a registry. RESTinio makes the first ones itself and gives no place for an
/// argument, so those take the registry that is `current` while the server is constructed; others are moved from them.
class tracked_socket : public asio::ip::tcp::socket {
public:
    static inline thread_local std::shared_ptr<socket_registry> current;

    explicit tracked_socket(asio::io_context& context) : asio::ip::tcp::socket(context), registry_(current) { enter(); }
    tracked_socket(tracked_socket&& other)
        : asio::ip::tcp::socket(std::move(other)),
          registry_(other.registry_) {
        enter();
    }
    tracked_socket& operator=(tracked_socket&&) = delete;
    ~tracked_socket() {
        if (registry_) registry_->sockets.erase(this);
    }

private:
    void enter() {
        if (registry_) registry_->sockets.insert(this);
    }
    std::shared_ptr<socket_registry> registry_;
};

} // namespace atirma
