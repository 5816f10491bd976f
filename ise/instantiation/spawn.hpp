#pragma once
#include <ise/core/result.hpp>
#include <ise/instantiation/launch_order.hpp>

namespace ise::instantiation {

/// Starts a program at the head of a process group of its own, with nothing open but its three streams: input from
/// nowhere, output appended to the order's file, or to the descriptor `output` where that is not negative. Gives its
/// number, greater than 1; the caller reaps it. errc::io_failed.
result<int> spawn(const launch_order& what, int output = -1);

} // namespace ise::instantiation
