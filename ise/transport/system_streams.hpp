#pragma once
#include <ise/core/environment.hpp>
#include <ise/transport/security.hpp>

/// For the transports whose streams the environment itself has: sockets of the system, or of the virtual network.
namespace ise::net {

/// `environment::connect`, with its errors and its cancellation; `with` is not used.
task<result<std::unique_ptr<stream>>> connect_by_environment(loop& on, endpoint to, security with);
/// `environment::listen`, with its errors; `with` is not used.
result<std::unique_ptr<listener>> listen_by_environment(loop& on, const endpoint& at, security with);

} // namespace ise::net
