#pragma once
#include <ise/core/environment.hpp>
#include <ise/net/tls/identity.hpp>

/// Sessions over TLS 1.3 with certificates on both sides, on the tcp streams of whatever environment the loop belongs
/// to.
namespace ise::net::tls {

/// Connects, and checks that the certificate shown is valid and for `to.host`. Errors: errc::unreachable,
/// errc::unauthorized with what is wrong with the certificate, errc::protocol_error where no TLS is spoken.
/// Cancellation: terminal, nothing is left open. That the other side refuses the certificate of this one is known at
/// the first read only.
task<result<std::unique_ptr<stream>>> connect(loop& on, endpoint to, std::shared_ptr<identity> with);

/// Errors: as environment::listen. The streams accepted shake hands in their first read.
result<std::unique_ptr<listener>> listen(loop& on, const endpoint& at, std::shared_ptr<identity> with);

} // namespace ise::net::tls
