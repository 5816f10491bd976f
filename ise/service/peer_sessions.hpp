#pragma once
#include <ise/service/resolver.hpp>
#include <ise/service/session.hpp>
#include <ise/transport/security.hpp>
#include <ise/transport/udp/cookie.hpp>

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace ise {

/// The sessions of one component, whoever made them, and how it presents itself to peers.
class peer_sessions {
public:
    /// Lifetime: what `shared` names outlives it.
    peer_sessions(const session_context& shared, security credentials);
    ~peer_sessions();

    /// What is shown to peers, and demanded of them.
    const security& credentials() const noexcept { return credentials_; }
    /// A hello of ours to whoever listens.
    wire::hello greeting() const;
    /// A hello of ours to who is meant to listen at `at`; `connected` is that as a numeric address, where it has one.
    wire::hello greeting_to(const location& whom, const endpoint& at, const std::string& connected);

    /// Connects to one endpoint and greets, at most until `deadline`. The failures are those of net::connect_until and
    /// net::initiate. Cancellation: terminal, nothing is left.
    task<result<std::shared_ptr<session>>> connect(location whom, endpoint at, time_point deadline,
                                                   std::weak_ptr<session_owner> owner);
    /// What the access policy has against the path that a peer says to have. Nothing: it may have it, or has none, or
    /// there is no policy.
    std::optional<failure> objection_to_name(const net::session_peer& peer) const;
    /// Runs a fresh connection as a session.
    std::shared_ptr<session> run(std::shared_ptr<net::connection> connection, std::weak_ptr<session_owner> owner);

    const std::map<session*, std::shared_ptr<session>>& all() const noexcept { return all_; }

    /// Decides anew over all that is allowed.
    void review_access();
    /// Ends those whose certificate has been revoked.
    void end_revoked();
    /// Ends every session, saying why.
    void finish_all(const failure& why, duration grace);
    /// Completes once none is left, or at `limit`. Cancellation: nothing is lost.
    task<> ended(time_point limit);

private:
    std::uint64_t reply_key_for(const location& whom, const endpoint& at);
    void forget(session& ended);
    std::vector<std::shared_ptr<session>> in_order() const;

    session_context shared_;
    security credentials_;
    std::map<session*, std::shared_ptr<session>> all_;
    std::vector<waiter<>*> awaiting_end_;
    std::optional<net::udp::secret> reply_secret_; // once a session over udp was made
};

} // namespace ise
