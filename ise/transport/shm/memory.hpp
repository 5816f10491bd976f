#pragma once
#include <ise/core/real/descriptor.hpp>
#include <ise/core/result.hpp>
#include <ise/transport/shm/byte_ring.hpp>

#include <array>
#include <cstdint>
#include <optional>
#include <span>

/// What a shared-memory connection asks of the operating system: memory that cannot shrink, doorbells, and descriptors
/// that are passed over a local socket.
namespace ise::net::shm {

using real::owned_fd;

inline constexpr std::uint32_t min_ring_bytes = 64 * 1024;
inline constexpr std::uint32_t max_ring_bytes = 1024 * 1024;

/// Bytes of one ring on this machine: a 65,536th of its memory, as a power of two within the bounds above.
std::uint32_t ring_bytes_here() noexcept;
/// Whether a ring may be so large.
bool is_ring_size(std::uint32_t bytes) noexcept;

/// Two rings, mapped into this process: a page with their states, then their contents.
class mapping {
public:
    mapping() noexcept = default;
    mapping(mapping&& other) noexcept;
    mapping& operator=(mapping&& other) noexcept;
    ~mapping();

    /// Maps memory of a peer. Errors: errc::protocol_error if it is not what `ring_bytes` says, or may still shrink;
    /// errc::io_failed.
    static result<mapping> of(const owned_fd& memory, std::uint32_t ring_bytes);
    /// Bytes of the whole.
    static std::size_t size_for(std::uint32_t ring_bytes) noexcept;

    /// Ring 0: from the side that connected; 1: to it.
    ring_writer writer(int ring) const noexcept;
    ring_reader reader(int ring) const noexcept;

private:
    ring_state& state(int ring) const noexcept;
    std::byte* content(int ring) const noexcept;

    std::byte* begin_ = nullptr;
    std::uint32_t ring_bytes_ = 0;
};

/// The descriptors of a connection, as the side that connects passes them.
struct descriptors {
    owned_fd memory;
    owned_fd connecting_bell; ///< rings the side that connected
    owned_fd accepting_bell;
};
inline constexpr std::size_t descriptor_count = 3;

/// New memory, sealed, and two bells. Errors: errc::io_failed.
result<descriptors> make_descriptors(std::uint32_t ring_bytes);
/// Those of a peer, in their order. Errors: errc::protocol_error if they are too many or not bells; errc::io_failed if
/// there are fewer (this process has none left) or it cannot be told what they are.
result<descriptors> take_descriptors(std::span<owned_fd> passed);

/// Whether the process at the other end of a local socket is of the same user, and among the same processes (PID and
/// user namespace): one that could stop this process anyway.
bool is_kindred(int socket);

/// Sends bytes together with descriptors over a local socket that has room. Whether all went.
bool send_with(int socket, std::span<const std::byte> bytes, const descriptors& passed) noexcept;

/// Another descriptor of the same; none: there is none left.
owned_fd duplicate(int of) noexcept;

} // namespace ise::net::shm
