#pragma once
#include <ise/core/environment.hpp>
#include <ise/core/waiter.hpp>
#include <ise/sim/resource.hpp>
#include <ise/sim/socket_owner.hpp>

#include <deque>
#include <memory>

namespace ise::sim {

/// What listens on a port (or a local path) of a host: the kernel's part of a listener.
class tcp_acceptor final : public resource, public std::enable_shared_from_this<tcp_acceptor> {
public:
    static constexpr std::size_t backlog_limit = 128;
    struct outcome { // not std::error_code: Asio would throw it
        std::error_code problem;
    };

    tcp_acceptor(socket_owner& owner, loop& on, endpoint at);
    ~tcp_acceptor() override;

    bool full() const noexcept { return backlog_.size() >= backlog_limit; }
    socket_owner& owner() noexcept { return owner_; }
    loop& on() noexcept { return loop_; }
    const endpoint& at() const noexcept { return at_; }
    void push(std::unique_ptr<stream> connected);

    std::pair<std::error_code, std::unique_ptr<stream>> take(); ///< would_block: nothing yet
    void close();
    void end(ending how) override;

    waiter<outcome> incoming;

private:
    void leave();

    socket_owner& owner_;
    std::shared_ptr<flow> where_;
    loop& loop_;
    endpoint at_;
    std::deque<std::unique_ptr<stream>> backlog_;
    bool closed_ = false;
};

/// What listens there for who connects to `to`, or null.
tcp_acceptor* acceptor_for(const machine& there, const endpoint& to);

/// Listens on a port or local path of the host of `owner`.
result<std::unique_ptr<listener>> listen_tcp(socket_owner& owner, loop& on, const endpoint& at);

/// Connects from the host of `owner`, over tcp or local. errc::unreachable. Cancellation: terminal, returns
/// errc::cancelled. `owner` outlives it.
task<result<std::unique_ptr<stream>>> connect_tcp(socket_owner& owner, loop& on, endpoint to);

} // namespace ise::sim
