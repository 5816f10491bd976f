#pragma once
#include <ise/naming/services.hpp>
#include <ise/service/link.hpp>
#include <ise/service/remote.hpp>

#include <cstdint>
#include <map>
#include <string>

namespace ise {

/// Finds components through the name server, for one component and on its loop.
///
/// What was found once is remembered and used while the name server is away or has just restarted: sessions are made
/// again to where the component was last known to be. Lifetime: the host outlives it.
class name_resolver final : public resolver {
public:
    name_resolver(service_host& host, endpoint name_server);
    ~name_resolver();

    /// errc::no_such_name: nobody holds it; errc::unreachable: it has no endpoint that reaches this process;
    /// errc::name_server_lost: the server cannot say, and the component was never found before.
    /// Cancellation: terminal.
    task<result<location>> resolve(std::string path) override;
    /// The same, with errc::no_such_name or errc::name_server_lost only at `deadline`.
    task<result<location>> resolve_when_present(std::string path, time_point deadline) override;

    const endpoint& name_server() const noexcept { return server_; }

private:
    struct memory {
        location where;
        std::uint64_t used = 0;
    };

    remote server();
    result<location> take(const std::string& path, result<naming::resolve_response> answer);
    const location* recall(const std::string& path);
    void remember(const std::string& path, const location& where);

    service_host& host_;
    endpoint server_;
    remote held_; // the session to the server, for as long as questions come
    timer idle_;
    std::map<std::string, memory> known_;
    std::uint64_t uses_ = 0;
    time_point lost_at_ = time_point::min(); // when the server did not answer last
};

/// The endpoints of `from` that reach this process, nearest first: in-process names within one process, local sockets
/// and loopback addresses within one host, then addresses that others reach. Unreadable ones are passed over.
std::vector<endpoint> reachable_endpoints(const naming::resolve_response& from, const process_identity& here);

} // namespace ise
