#pragma once
#include <ise/call/reply_cache.hpp>
#include <ise/service/caution.hpp>
#include <ise/service/dispatcher.hpp>
#include <ise/service/peer_channel.hpp>
#include <ise/service/peer_sessions.hpp>
#include <ise/service/session_acceptor.hpp>
#include <ise/service/use_book.hpp>
#include <ise/session/service_runtime.hpp>

#include <algorithm>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

namespace ise {

/// The services of one component: what it provides, whom it talks to. Puts the parts together, each of which knows only
/// what it needs. Everything on the component's loop.
/// Lifetime: `stop()` and join the scope before destroying it.
class service_host final : public service_runtime {
public:
    service_host(environment& env, loop& on, task_scope& scope, wire::identity self, service_options options,
                 logger log, security credentials = security());
    ~service_host();

    dispatcher& services() noexcept { return dispatcher_; }
    pending_calls& calls() noexcept { return calls_; }
    /// What it uses of others, and waits for.
    use_book& uses() noexcept { return uses_; }
    const use_book& uses() const noexcept { return uses_; }
    /// What was answered to clients that may ask again.
    ise::reply_windows& reply_windows() noexcept { return reply_windows_; }
    peer_sessions& peers() noexcept { return peers_; }
    const std::map<session*, std::shared_ptr<session>>& sessions() const noexcept { return peers_.all(); }
    session_acceptor& acceptor() noexcept { return acceptor_; }
    /// As session_acceptor's.
    result<endpoint> listen(const endpoint& at) { return acceptor_.listen(at); }
    std::vector<endpoint> listening() const { return acceptor_.listening(); }

    /// The link to a path or an endpoint; one for all who talk to it, and to a role in the same way.
    std::shared_ptr<peer_channel> link_to(const std::string& path, role_options how = role_options());
    /// `path`: of the component that is to answer there; empty: whoever listens.
    std::shared_ptr<peer_channel> link_to(const endpoint& at, const std::string& path = std::string()) {
        return link_to(std::vector<endpoint>{at}, path);
    }
    /// To the component at one of several endpoints, the next one where one is lost.
    std::shared_ptr<peer_channel> link_to(const std::vector<endpoint>& any_of, const std::string& path);
    /// Back to the peer of a session that it made.
    std::shared_ptr<peer_channel> link_back(const std::shared_ptr<session>& over);
    /// How many links it keeps track of; about half of them may have gone.
    std::size_t known_links() const noexcept { return links_.size(); }
    ise::resolver* resolver() const noexcept { return links_share_.names.get(); }
    void use_resolver(std::shared_ptr<ise::resolver> names) { links_share_.names = std::move(names); }

    /// Says goodbye on every session, stops listening and serving. What was read is answered for at most `grace`.
    void stop(duration grace);
    /// Ends every session and makes none until `go_on()`: what is provided changes hands. Peers come back by
    /// themselves.
    void pause(const failure& why, duration grace);
    void go_on() noexcept { acceptor_.go_on(); }

    /// What people should know of how this component was set up: `ise doctor` shows it. On the component's loop.
    void warn_of(caution what) {
        if (std::ranges::count(cautions_, what) == 0 && cautions_.size() < max_cautions)
            cautions_.push_back(std::move(what));
    }
    const std::vector<caution>& cautions() const noexcept { return cautions_; }

    /// From now on an edit of the access policy, and a certificate that is revoked, count for sessions that exist, too;
    /// where there is a policy or a certificate.
    void follow_access();
    /// The roles that it serves: rules that name one are about it, too.
    void serve_as(std::vector<std::string> roles);

private:
    std::weak_ptr<peer_channel>& known_link(const std::string& key);
    void watch_access();
    void follow_policy();

    static constexpr std::size_t max_cautions = 32;

    std::vector<caution> cautions_;
    use_book uses_;
    channel_context links_share_; // before the calls, which keep links
    pending_calls calls_;
    dispatcher dispatcher_;
    ise::reply_windows reply_windows_;
    std::map<std::string, std::weak_ptr<peer_channel>> links_;
    std::size_t sweep_links_at_ = 0; // so many of them
    session_acceptor acceptor_;      // before the sessions, which hold places of it
    peer_sessions peers_;
    std::unique_ptr<timer> access_watch_; // where there is a policy or a certificate
    std::uint64_t access_seen_ = 0;       // which of its versions
};

} // namespace ise
