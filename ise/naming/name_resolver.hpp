#pragma once
#include <ise/naming/role_watch.hpp>
#include <ise/naming/services.hpp>
#include <ise/service/peer_channel.hpp>
#include <ise/service/remote.hpp>

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

namespace ise {

/// Finds components through the name server, for one component and on its loop.
///
/// What was found once is remembered and used while the name server is away or has just restarted: sessions are made
/// again to where the component was last known to be. Of a role that is followed every change is known as it happens,
/// so that a handle goes on with another member without asking anybody. Lifetime: the host outlives it.
class name_resolver final : public resolver {
public:
    /// `name_servers`: as for `lease_registrar`.
    name_resolver(service_host& host, std::vector<endpoint> name_servers);
    ~name_resolver();

    /// errc::no_such_name: nobody holds it, or serves the role; errc::unreachable: there is no endpoint that reaches
    /// this process; errc::name_server_lost: the server cannot say, and nobody was ever found there. Cancellation:
    /// terminal.
    task<result<resolution>> resolve(std::string path) override;
    /// The same, with errc::no_such_name or errc::name_server_lost only at `deadline`.
    task<result<resolution>> resolve_when_present(std::string path, time_point deadline) override;
    /// The server tells it when it happens.
    task<std::uint64_t> next_life(std::string path, std::uint64_t than, time_point deadline) override;
    std::string trouble() const override;

    void follow(const std::string& role, peer_channel& who) override;
    void unfollow(const std::string& role, peer_channel& who) noexcept override;

    const std::vector<endpoint>& name_servers() const noexcept { return servers_; }

private:
    struct memory {
        resolution who;
        std::uint64_t used = 0;
    };
    struct followed {
        std::unique_ptr<role_watch> watch;
        std::vector<peer_channel*> by;
    };

    remote server();
    /// What a question that was given this long tells of the server.
    void note_server(const failure* why, duration waited);
    result<resolution> take(const std::string& path, result<naming::resolve_response> answer);
    result<resolution> take_members(const std::string& role, const std::vector<naming::role_member>& members,
                                    bool certain);
    void on_news(const naming::role_members& outcome);
    const resolution* recall(const std::string& path);
    void remember(const std::string& path, const resolution& who);

    service_host& host_;
    std::vector<endpoint> servers_;
    remote held_; // the session to the server, for as long as questions come
    timer idle_;
    std::map<std::string, memory> known_;
    std::map<std::string, followed> followed_; // by role
    std::uint64_t uses_ = 0;
    time_point lost_at_ = time_point::min(); // when the server did not answer last
};

/// The endpoints of `from` that reach this process, nearest first: in-process names within one process, local sockets
/// and loopback addresses within one host, then addresses that others reach. Unreadable ones are passed over.
std::vector<endpoint> reachable_endpoints(const naming::resolve_response& from, const process_identity& here);

} // namespace ise
