#pragma once
#include <ise/core/environment.hpp>
#include <ise/net/bounded_acceptor.hpp>
#include <ise/service/peer_sessions.hpp>

#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace ise {

/// Where a component listens: greets who comes, decides who is admitted, and shares its places fairly among hosts.
class session_acceptor {
public:
    /// Lifetime: both outlive it.
    session_acceptor(service_runtime& runtime, peer_sessions& sessions);

    /// Listens and accepts sessions. errc::address_in_use and others as environment::listen, errc::unauthorized where
    /// credentials are demanded and there are none for `at`.
    result<endpoint> listen(const endpoint& at);
    /// Where it listens, with real ports.
    std::vector<endpoint> listening() const;
    /// Further endpoints that peers may have dialled: those of tunnels and address translations that lead here. With a
    /// shared key, sessions that were dialled elsewhere are refused as relayed.
    void advertise(std::vector<endpoint> through) { advertised_ = std::move(through); }

    /// Whoever connects waits at the listeners, until `begin()`.
    void hold() noexcept { held_ = true; }
    void begin();
    /// Stops listening.
    void close();
    /// Admits nobody until `go_on()`.
    void pause(const failure& why) { paused_ = why; }
    void go_on() noexcept { paused_.reset(); }

private:
    class door;             // for one stranger
    struct session_places { // null: it needs none
        std::unique_ptr<net::fair_places::place> socket, session;
    };
    using handshake_place = std::shared_ptr<net::fair_places::place>;

    void accept_from(const std::shared_ptr<listener>& from);
    void take(net::admitted who, const endpoint& at);
    task<> greet(std::unique_ptr<stream> stranger, endpoint reached, handshake_place place);
    /// What the access policy has against a caller who says to be that.
    std::optional<failure> objection(const wire::hello& caller, const verified_peer& as) const;
    /// `into`: the places of the session that is to be made.
    result<wire::welcome> admit(const wire::hello& caller, const std::string& peer, protocol over,
                                session_places& into);
    /// A place among `all` for one more session of that peer.
    result<std::unique_ptr<net::fair_places::place>> place_for(const std::string& peer, net::fair_places& all) const;
    std::string session_limit(const net::fair_places& all) const;
    /// It keeps them for as long as it lives, or until another host needs one.
    void keep_places(session& of, session_places held);
    void make_way(session& which, const net::fair_places& all);

    service_runtime& runtime_;
    peer_sessions& sessions_;
    std::vector<std::shared_ptr<listener>> listeners_;
    std::vector<endpoint> advertised_;
    std::optional<failure> paused_;
    bool held_ = false;
    net::fair_places places_;                 // of sessions that other processes made
    std::optional<net::fair_places> sockets_; // of those that have a descriptor each; once it listens for such
    net::fair_places handshakes_;
    std::size_t greeting_ = 0; // coroutines: those that lost their place and are on their way out included
};

} // namespace ise
