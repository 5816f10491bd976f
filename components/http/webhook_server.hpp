#pragma once
#include <components/http/http_requests.hpp>

#include <ise/core/environment.hpp>
#include <ise/core/log.hpp>
#include <ise/core/log_limiter.hpp>
#include <ise/core/task.hpp>
#include <ise/net/bounded_acceptor.hpp>

#include <functional>
#include <memory>
#include <string>

namespace atirma {

struct webhook_limits {
    http_reader_limits message;
    std::size_t max_connections = 32; ///< beyond it `ise::net::fair_places` decides; 503
    std::size_t max_requests = 1000;  ///< of one connection
    http_times times;                 ///< the time for a request also bounds writing its answer
};

struct webhook_request {
    http_message message;
    std::string peer; ///< "tcp://10.0.0.2:40112"
};
struct webhook_answer {
    int status = 200;
    std::string body; ///< text/plain
};

/// A small HTTP/1.1 server over the environment's listener, so that it runs on the virtual world, too: for the posts of
/// a gateway, not for browsers. One handler answers every request. Used on one loop; outlives its tasks.
class webhook_server {
public:
    using handler = std::function<ise::task<webhook_answer>(webhook_request)>;
    /// Starts a coroutine that somebody else owns, and ends before this server is destroyed: a component's `spawn`.
    using spawner = std::function<void(std::string name, ise::task<> body)>;

    webhook_server(ise::loop& on, ise::logger log, webhook_limits limits, handler answer, spawner spawn);

    /// Errors: address_in_use, invalid_argument, io_failed.
    ise::result<void> listen(const ise::endpoint& at);
    ise::endpoint where() const { return listener_->where(); }

    /// Accepts until it is cancelled.
    ise::task<> run();

    std::uint64_t requests() const noexcept { return requests_; }
    /// Connections and requests that were no HTTP, or too much.
    std::uint64_t refused() const noexcept { return refused_; }
    std::size_t connections() const noexcept { return places_.taken(); }

private:
    ise::task<> serve(ise::net::admitted who);
    ise::task<> converse(std::string peer, ise::net::admitted who);
    ise::task<> turn_away(std::unique_ptr<ise::stream> line);
    void note(std::string_view what, const std::string& peer);

    ise::loop& loop_;
    ise::logger log_;
    webhook_limits limits_;
    handler answer_;
    spawner spawn_;
    ise::log_limiter quiet_;
    ise::net::fair_places places_;
    std::shared_ptr<ise::listener> listener_;
    std::size_t turned_away_ = 0;
    std::uint64_t requests_ = 0, refused_ = 0;
};

} // namespace atirma
