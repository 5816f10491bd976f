#pragma once
#include <components/nmea_bridge/services.hpp>

#include <ise/component/component.hpp>
#include <ise/core/waiter.hpp>
#include <ise/net/bounded_acceptor.hpp>

#include <functional>
#include <list>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace atirma {

struct outlet_options {
    std::optional<ise::endpoint> tcp; ///< where it listens
    std::vector<ise::endpoint> udp;   ///< whom it sends to
    std::size_t max_clients = 50;
    std::size_t max_queued_bytes = 64 * 1024; ///< of one client; one that takes less is dropped
};

/// Gives lines out to TCP clients and UDP addresses: a slow client costs a bounded amount of memory and slows nobody.
/// What clients say is not heard. Lifetime: as long as the component's flow; its coroutines are the component's.
class line_outlet {
public:
    /// `greeting`: what a new client is told first. Throws ise::error: address_in_use, invalid_argument, io_failed.
    line_outlet(ise::component& owner, outlet_options options, std::function<std::string()> greeting);
    ~line_outlet();
    line_outlet(const line_outlet&) = delete;
    line_outlet& operator=(const line_outlet&) = delete;

    /// Whole lines, one datagram's worth.
    void send(const std::string& lines);
    outlet_status status() const;

private:
    struct client;
    struct state;
    static void take(const std::shared_ptr<state>& self, ise::net::admitted who);
    static ise::task<> write(std::shared_ptr<state> self, std::shared_ptr<client> to);
    static ise::task<> read(std::shared_ptr<state> self, std::shared_ptr<client> from);

    std::shared_ptr<state> state_;
};

} // namespace atirma
