#pragma once
#include <optional>

#include <sys/socket.h>

namespace ise::real {

/// The process that made the other end of a local socket, as the system knows it; nothing of other sockets.
std::optional<ucred> credentials_of_peer(int socket) noexcept;

} // namespace ise::real
