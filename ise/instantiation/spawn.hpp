#pragma once
#include <ise/core/result.hpp>
#include <ise/instantiation/launch_order.hpp>

namespace ise::instantiation {

/// Starts a program at the head of a process group of its own, with nothing open but its three streams: input from
/// nowhere, output to the descriptor `output`. Gives its number, greater than 1; the caller reaps it. Of the order it
/// uses the program, the words and the variables. errc::io_failed.
result<int> spawn(const launch_order& what, int output);

} // namespace ise::instantiation
