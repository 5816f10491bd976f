#pragma once
#include <ise/core/bytes.hpp>
#include <ise/core/real/descriptor.hpp>
#include <ise/core/stream.hpp>

#include <asio/buffer.hpp>
#include <asio/detail/socket_types.hpp> // sockaddr and the constants of the system

#include <cstddef>
#include <optional>
#include <span>
#include <utility>
#include <vector>

// The sockets of the operating system, the same over each: linux/, windows/. All are non-blocking and are not inherited
// by other processes. Errors are the system's, in the category of Asio.
namespace ise::real {

/// None: `last_system_error()`.
owned_fd new_socket(int family, int type) noexcept;
/// A socket that listens, or `asio::error::would_block`. A client that has left already is passed over.
std::pair<std::error_code, owned_fd> accept_from(int listening) noexcept;
/// Begins to connect: `asio::error::in_progress` until it is writable; `pending_error` has the outcome then.
std::error_code begin_to_connect(int socket, const sockaddr* to, socklen_t size) noexcept;
std::error_code pending_error(int socket) noexcept;
/// Before it is bound: a restarted program gets its port back, and no other program can take it meanwhile.
std::error_code claim_port(int socket) noexcept;
void set_option(int socket, int level, int name, int value) noexcept; ///< as far as the socket has it

/// At the end `asio::error::eof`, where there is nothing `asio::error::would_block`.
transfer receive_bytes(int socket, asio::mutable_buffer into) noexcept;
/// The same over a local socket, with the descriptors that the peer passes.
transfer receive_passed(int socket, asio::mutable_buffer into, std::vector<owned_fd>& passed);
transfer send_bytes(int socket, std::span<const asio::const_buffer> from) noexcept;
void limit_unsent_bytes(int socket, std::size_t most) noexcept;
void end_sending(int socket) noexcept;

/// `size`: the room for the address, then its size.
transfer receive_datagram(int socket, asio::mutable_buffer into, sockaddr* from, socklen_t& size) noexcept;
std::error_code send_datagram(int socket, bytes_view content, const sockaddr* to, socklen_t size) noexcept;

/// The user at the other end of a local socket, as the system knows it; nothing of other sockets.
std::optional<std::uint32_t> user_of_peer(int socket) noexcept;

} // namespace ise::real
