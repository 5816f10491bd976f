#pragma once
#include <ise/core/real/descriptor.hpp>
#include <ise/core/result.hpp>
#include <ise/transport/shm/byte_ring.hpp>

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include <fcntl.h>

/// What a shared-memory connection asks of the operating system: memory that cannot shrink, doorbells, and descriptors
/// that are passed over a local socket.
namespace ise::net::shm {

using real::owned_fd;

inline constexpr std::uint32_t min_ring_bytes = 64 * 1024;
inline constexpr std::uint32_t max_ring_bytes = 1024 * 1024;

/// Seals that shared memory must have: it cannot shrink while a process reads it.
inline constexpr int demanded_seals = F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_SEAL;
/// The blocks that one side of a connection loans have at most so many bytes, all together.
inline constexpr std::size_t max_loaned_bytes = 64 * 1024 * 1024;

/// The memory of this machine; 0: unknown.
std::uint64_t machine_bytes() noexcept;
/// Whether this process has few descriptors left; `newest` was opened last.
bool is_late(const owned_fd& newest);

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
    /// The blocks of that ring's writer which its reader has given back, a bit each.
    std::span<ring_word, returned_words> returned(int ring) const noexcept { return state(ring).returned; }

private:
    ring_state& state(int ring) const noexcept;
    std::byte* content(int ring) const noexcept;

    std::byte* begin_ = nullptr;
    std::uint32_t ring_bytes_ = 0;
};

/// Maps memory of a peer for reading. Errors: errc::protocol_error if it has another size, or may still shrink;
/// errc::io_failed.
result<const std::byte*> map_to_read(const owned_fd& memory, std::size_t bytes);

/// The descriptors of a connection, as the side that connects passes them.
struct descriptors {
    owned_fd memory;
    owned_fd connecting_bell; ///< rings the side that connected
    owned_fd accepting_bell;
};
inline constexpr std::size_t descriptor_count = 3;

/// New memory that can still be sealed; `name` appears in /proc. Errors: errc::io_failed.
result<owned_fd> make_memory(const char* name, std::size_t bytes);
/// New memory, sealed, and two bells. Errors: errc::io_failed.
result<descriptors> make_descriptors(std::uint32_t ring_bytes);
/// Those of a peer, in their order. Errors: errc::protocol_error if they are too many or not bells; errc::io_failed if
/// there are fewer (this process has none left) or it cannot be told what they are.
result<descriptors> take_descriptors(std::span<owned_fd> passed);

/// Whether the process at the other end of a local socket is of the same user, and among the same processes (PID and
/// user namespace): one that could stop this process anyway.
bool is_kindred(int socket);

/// Sends bytes together with descriptors, at most `descriptor_count`, over a local socket that has room. Whether all
/// went.
bool send_with(int socket, std::span<const std::byte> bytes, std::span<const int> passed) noexcept;
bool send_with(int socket, std::span<const std::byte> bytes, const descriptors& passed) noexcept;

/// Another descriptor of the same; none: there is none left.
owned_fd duplicate(int of) noexcept;

} // namespace ise::net::shm
