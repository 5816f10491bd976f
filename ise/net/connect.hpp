#pragma once
#include <ise/core/environment.hpp>

namespace ise::net {

/// environment::connect under a deadline: errc::timed_out when it passes, and nothing is left open.
task<result<std::unique_ptr<stream>>> connect_until(loop& on, endpoint to, time_point deadline);

} // namespace ise::net
