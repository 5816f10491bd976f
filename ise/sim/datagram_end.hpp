#pragma once
#include <ise/core/environment.hpp>
#include <ise/core/waiter.hpp>
#include <ise/sim/resource.hpp>
#include <ise/sim/socket_owner.hpp>

#include <deque>
#include <memory>

namespace ise::sim {

/// A bound datagram port of a host.
class datagram_end final : public resource, public std::enable_shared_from_this<datagram_end> {
public:
    static constexpr std::size_t receive_limit_bytes = 256 * 1024;
    struct outcome { // not std::error_code: Asio would throw it
        std::error_code problem;
    };

    datagram_end(socket_owner& owner, loop& on, endpoint at);
    ~datagram_end() override;

    const endpoint& at() const noexcept { return at_; }
    socket_owner& owner() noexcept { return owner_; }

    void deliver_to(datagram_reader& reader, std::size_t max_bytes);
    std::pair<std::error_code, const datagram*> take(); ///< would_block: nothing yet; it stays until the next
    std::error_code send(const endpoint& to, bytes_view content);
    void arrive(datagram what);
    void close();
    void end(ending how) override;

    waiter<outcome> incoming;

private:
    void leave();
    void announce(); // what has come, in a turn of its own
    void deliver();

    socket_owner& owner_;
    std::shared_ptr<flow> where_;
    loop& loop_;
    endpoint at_;
    std::deque<datagram> received_;
    datagram taken_;
    datagram_reader* reader_ = nullptr;
    std::size_t max_bytes_ = 0;
    std::size_t received_bytes_ = 0;
    bool closed_ = false;
};

/// What hears there what is sent to `to`, or null.
datagram_end* datagram_for(const machine& there, const endpoint& to);

result<std::unique_ptr<datagram_socket>> open_udp(socket_owner& owner, loop& on, const endpoint& at);

} // namespace ise::sim
