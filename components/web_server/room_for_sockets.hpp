#pragma once
#include <cstddef>
#include <string>

namespace atirma {

/// Lets this process open `sockets` more files than it usually has open, as far as its hard limit allows. Empty, or
/// what will be too little and what to do. Many systems give programs 1024 unless they ask.
std::string make_room_for_sockets(std::size_t sockets);

} // namespace atirma
