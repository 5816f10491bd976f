#pragma once
#include <components/iridium/address_list.hpp>

#include <ise/core/bytes.hpp>
#include <ise/core/environment.hpp>
#include <ise/core/log.hpp>
#include <ise/core/log_limiter.hpp>
#include <ise/core/result.hpp>
#include <ise/core/task.hpp>
#include <ise/net/bounded_acceptor.hpp>

#include <functional>
#include <memory>
#include <string>

namespace atirma::iridium {

/// Sends one DirectIP message and gives the answer, whole. Errors: unreachable (nothing was sent), timed_out and
/// peer_lost (unknown whether it was taken), malformed, too_large. Cancellation: terminal.
ise::task<ise::result<ise::bytes>> ask_directip(ise::loop& on, ise::endpoint to, ise::bytes message,
                                                ise::duration within);

struct directip_limits {
    std::size_t max_connections = 16;                      ///< beyond it `ise::net::fair_places` decides
    ise::duration message_time = std::chrono::seconds(10); ///< for the whole message, and for the answer
    address_list allowed;                                  ///< connections from elsewhere are closed at once
};

/// Takes DirectIP connections: one message, one answer. Used on one loop; outlives its tasks.
class directip_server {
public:
    /// The answer to a whole message; empty: the connection is closed without one. `peer` is for logs.
    using handler = std::function<ise::bytes(ise::bytes_view message, const std::string& peer)>;
    using spawner = std::function<void(std::string name, ise::task<> body)>; ///< as http_server's

    directip_server(ise::loop& on, ise::logger log, directip_limits limits, handler answer, spawner spawn);

    /// Listens and accepts connections. Errors: address_in_use, invalid_argument, io_failed.
    ise::result<void> listen(const ise::endpoint& at);
    ise::endpoint where() const { return listener_->where(); }

private:
    void take(ise::net::admitted who);
    ise::task<> serve(ise::net::admitted who);
    void note(std::string_view what, const std::string& peer);

    ise::loop& loop_;
    ise::logger log_;
    directip_limits limits_;
    handler answer_;
    spawner spawn_;
    ise::log_limiter quiet_;
    ise::net::fair_places places_;
    std::shared_ptr<ise::listener> listener_;
};

} // namespace atirma::iridium
