#pragma once
#include <ise/instantiation/server_context.hpp>
#include <ise/transport/security.hpp>

#include <atomic>
#include <memory>
#include <string>
#include <string_view>

namespace ise::instantiation {

/// The path of a host's instantiation server: "ise/host/shore"; what cannot be in a path becomes a dash.
std::string path_of_host(std::string_view host_name);

/// Whether an instantiation server with these credentials may listen there, since whoever reaches it can start
/// programs: errc::unauthorized beyond this host, but with a shared key or on tls.
result<void> may_listen(const endpoint& at, const security& credentials);

/// The instantiation server of a host (ise/instantiation/services.hpp): starts components of the types that the
/// programs of a folder have, watches over them, and goes on with them when it was killed and is started again. It puts
/// its parts together (README.md) and provides their services.
///
/// `host` outlives it. Stopping it leaves alone what it started: the program around it ends that, or leaves it for
/// the next instantiation server.
class instantiation_server final : public component {
public:
    instantiation_server(machine& host, server_options options);
    ~instantiation_server() override;

    /// Whether it goes on with all that a server before it had started: until then that one's state is still needed.
    /// From any thread.
    bool has_taken_over() const noexcept { return took_over_; }

private:
    struct parts;

    task<> run() override;

    server_context here_;
    std::unique_ptr<parts> parts_; // as soon as it runs
    std::atomic<bool> took_over_ = false;
};

} // namespace ise::instantiation
