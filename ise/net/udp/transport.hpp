#pragma once
#include <ise/core/environment.hpp>

/// Sessions over datagrams, on the datagram sockets of whatever environment the loop belongs to.
namespace ise::net::udp {

/// A datagram_stream to whoever answers at `to`, asked again and again until then: the caller sets the limit.
/// Errors: errc::unreachable, errc::io_failed (no socket). Cancellation: terminal, nothing is left open.
task<result<std::unique_ptr<stream>>> connect(loop& on, endpoint to);

/// Errors: errc::address_in_use, errc::invalid_argument, errc::io_failed. After `close()` of the listener, `accept`
/// goes on serving the streams that it gave, and completes when the last of them has gone.
result<std::unique_ptr<listener>> listen(loop& on, const endpoint& at);

} // namespace ise::net::udp
