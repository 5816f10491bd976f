#pragma once
#include <ise/core/environment.hpp>
#include <ise/transport/security.hpp>

/// For the transports whose streams the environment itself has: sockets of the system, or of the virtual network.
namespace ise::net {

/// `environment::connect`, with its errors and its cancellation; `with` is not used.
task<result<std::unique_ptr<stream>>> connect_by_environment(loop& on, endpoint to, security with);
/// `environment::listen`, with its errors; `with` is not used.
result<std::unique_ptr<listener>> listen_by_environment(loop& on, const endpoint& at, security with);

/// The same, and the streams are sealed by the shared key of `with`, where it has one that seals: they are
/// `sealed_stream`s (FORMAT.md, section 17). Further errors: errc::unauthorized, where the peer does not prove the key.
/// Cancellation: terminal, no connection stays open.
task<result<std::unique_ptr<stream>>> connect_sealed(loop& on, endpoint to, security with);
/// The streams accepted shake hands in their first read.
result<std::unique_ptr<listener>> listen_sealed(loop& on, const endpoint& at, security with);

/// What both do with a stream to `to`, and with a listener, that were made in another way. Errors and cancellation as
/// above.
task<result<std::unique_ptr<stream>>> seal(loop& on, std::unique_ptr<stream> made, endpoint to, security with);
std::unique_ptr<listener> seal(loop& on, std::unique_ptr<listener> made, security with);

} // namespace ise::net
