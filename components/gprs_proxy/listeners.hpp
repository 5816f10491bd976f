#pragma once
#include <components/byte_stream/outgoing.hpp>
#include <components/gprs/shore.hpp>

#include <ise/core/environment.hpp>
#include <ise/core/log.hpp>
#include <ise/core/loop.hpp>
#include <ise/core/task.hpp>
#include <ise/transport/security.hpp>

#include <array>
#include <functional>
#include <map>
#include <memory>
#include <vector>

namespace atirma {

/// The sockets of the GPRS proxy: listeners, the connections that they accepted, and sockets for datagrams. It decides
/// nothing; what comes is told, what is to go is written. Used on one loop; must outlive the coroutines that it spawns.
class listeners {
public:
    /// Of a connection; what is more is left out: all of it can be said again.
    static constexpr std::size_t most_unwritten = 64 * 1024;
    static constexpr std::size_t largest_datagram = 2048; ///< a longer one makes no sense

    /// `spawn` starts a coroutine that the component owns.
    /// `security`: with `tls` for tls endpoints.
    listeners(ise::loop& on, ise::logger log, std::function<void(std::string, ise::task<>)> spawn,
              ise::security security = ise::security())
        : loop_(on), log_(std::move(log)), spawn_(std::move(spawn)), security_(std::move(security)) {}

    std::function<void(const gprs::way&)> on_connected;
    std::function<void(std::uint64_t channel, ise::bytes_view)> on_bytes;
    std::function<void(std::uint64_t channel, const std::string& reason)> on_disconnected; ///< not after `cut`
    /// Over tls: a peer whose certificate was refused, or which does not speak it. `on_disconnected` follows.
    std::function<void(const std::string& peer, const std::string& reason)> on_unverified;
    std::function<void(const gprs::way&, ise::bytes_view)> on_datagram;

    /// Listens there, for connections (tcp) or datagrams (udp), as long as the component runs. Gives the endpoint with
    /// its real port. Errors: as environment::listen; invalid_argument for another kind of endpoint.
    ise::result<ise::endpoint> open(const ise::endpoint& at);

    void send(const gprs::way& to, std::string_view text);
    void cut(std::uint64_t channel);

    std::size_t connections() const noexcept { return lines_.size(); }

private:
    struct line {
        std::unique_ptr<ise::stream> stream;
        outgoing unwritten;
        bool cut = false;
    };

    void take(std::unique_ptr<ise::stream> boat);
    ise::task<> read(std::uint64_t channel, std::shared_ptr<line> from);
    ise::task<> receive(std::uint64_t channel, std::shared_ptr<ise::datagram_socket> at);
    void write_again();

    ise::loop& loop_;
    ise::logger log_;
    std::function<void(std::string, ise::task<>)> spawn_;
    ise::security security_;
    std::map<std::uint64_t, std::shared_ptr<line>> lines_;
    std::map<std::uint64_t, std::shared_ptr<ise::datagram_socket>> sockets_;
    ise::timer again_{loop_, [this] { write_again(); }};
    std::uint64_t last_channel_ = 0;
};

} // namespace atirma
