#pragma once
#include <ise/core/environment.hpp>

#include <memory>

namespace ise::net {

/// Listens for sessions: environment::listen, and for udp a listener whose streams lie in datagrams.
result<std::unique_ptr<listener>> listen(loop& on, const endpoint& at);

/// environment::connect under a deadline, and for udp a stream in datagrams: errc::timed_out when it passes, and nothing is left open.
task<result<std::unique_ptr<stream>>> connect_until(loop& on, endpoint to, time_point deadline);

} // namespace ise::net
