#pragma once
#include <ise/core/loop.hpp>
#include <ise/core/task.hpp>

namespace ise {

/// Suspends until `at` on the loop's clock. Cancellation: terminal, throws `operation_aborted`.
task<> sleep_until(loop& on, time_point at);

/// Suspends for `length`; with zero or less, other coroutines run once. Cancellation: as above.
task<> sleep_for(loop& on, duration length);

} // namespace ise
