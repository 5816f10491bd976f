#include <ise/core/real/linux/receive_ring.hpp>

// Where the system's headers do not know io_uring well enough: sockets are left to epoll.
namespace ise::real {

receive_ring::memory::~memory() = default;
std::unique_ptr<receive_ring> receive_ring::make(int) { return nullptr; }
receive_ring::~receive_ring() = default;
void receive_ring::begin(descriptor&) {}
void receive_ring::leave(std::uint32_t) noexcept {}
void receive_ring::forget(descriptor&) noexcept {}
bool receive_ring::wait(bool) noexcept { return false; }
void receive_ring::deliver(loop&) {}

} // namespace ise::real
