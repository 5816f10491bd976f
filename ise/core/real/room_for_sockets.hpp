#pragma once
#include <cstddef>

namespace ise {

/// Lets this process open `wanted` more files than it usually has open, as far as its hard limit allows. How many
/// sockets it can hold then: `wanted`, or fewer. Many systems give programs 1024 unless they ask.
std::size_t room_for_sockets(std::size_t wanted);

} // namespace ise
