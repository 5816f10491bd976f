#pragma once
#include <ise/core/environment.hpp>

#include <memory>

namespace ise::net::tls {
class identity;
}

namespace ise::net {

/// Listens for sessions: environment::listen, for udp a listener whose streams lie in datagrams, and for tls one whose
/// streams shake hands in their first read. tls takes a certificate: errc::invalid_argument without.
result<std::unique_ptr<listener>> listen(loop& on, const endpoint& at, std::shared_ptr<tls::identity> with = nullptr);

/// environment::connect under a deadline, for udp a stream in datagrams and for tls one that has shaken hands:
/// errc::timed_out when it passes, and nothing is left open. errc::unauthorized where certificates do not do.
/// Cancellation: terminal, returns errc::cancelled and ends the attempt.
task<result<std::unique_ptr<stream>>> connect_until(loop& on, endpoint to, time_point deadline,
                                                    std::shared_ptr<tls::identity> with = nullptr);

} // namespace ise::net
