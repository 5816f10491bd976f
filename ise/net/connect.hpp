#pragma once
#include <ise/core/environment.hpp>
#include <ise/transport/security.hpp>

#include <memory>

namespace ise::net {

/// Connects to an endpoint of any transport, as `transport::connect`, under a deadline. Errors: those of the transport,
/// errc::timed_out at the deadline. Cancellation: terminal. In either case nothing stays open.
task<result<std::unique_ptr<stream>>> connect_until(loop& on, endpoint to, time_point deadline, security with);
/// The same without credentials.
task<result<std::unique_ptr<stream>>> connect_until(loop& on, endpoint to, time_point deadline);

} // namespace ise::net
