#include <ise/core/real/room_for_sockets.hpp>

namespace ise {

std::size_t room_for_sockets(std::size_t wanted) { return wanted; } // sockets have no limit of their own here

} // namespace ise
