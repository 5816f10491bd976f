#include <ise/core/real/system_sockets.hpp>

#include <ise/core/real/system_errors.hpp>

#include <asio/buffer.hpp>
#include <asio/error.hpp>
#include <asio/ip/tcp.hpp> // starts Winsock

#include <algorithm>
#include <array>

#include <mstcpip.h>

namespace ise::real {
namespace {

// A SOCKET has 32 significant bits, as every handle that processes share.
SOCKET number_of(int socket) noexcept { return static_cast<SOCKET>(socket); }

// None: the socket is closed, and `last_system_error` says why.
owned_fd made_ready(SOCKET made) noexcept {
    if (made == INVALID_SOCKET) return owned_fd();
    owned_fd held(static_cast<int>(made));
    u_long yes = 1;
    if (::ioctlsocket(made, FIONBIO, &yes) != 0) return owned_fd();
    ::SetHandleInformation(reinterpret_cast<HANDLE>(made), HANDLE_FLAG_INHERIT, 0);
    return held;
}

transfer outcome_of(int code, DWORD count) noexcept {
    if (code == 0) return {{}, count};
    return {last_system_error(), 0};
}

} // namespace

void owned_fd::reset(int fd) noexcept {
    if (fd_ >= 0) ::closesocket(number_of(fd_));
    fd_ = fd;
}

std::error_code last_system_error() noexcept { return {::WSAGetLastError(), asio::error::get_system_category()}; }

bool is_address_taken(const std::error_code& why) noexcept { return why.value() == WSAEADDRINUSE; }

bool is_out_of_descriptors(const std::error_code& why) noexcept { return why.value() == WSAEMFILE; }

bool is_out_of_memory(const std::error_code& why) noexcept {
    return why.value() == WSAENOBUFS || why.value() == ERROR_OUTOFMEMORY || why.value() == ERROR_NOT_ENOUGH_MEMORY;
}

std::string_view advice_on(const std::error_code& why) noexcept {
    switch (why.value()) {
        case WSAEADDRINUSE: return " (`netstat -ano` shows the process: end it, or use another endpoint)";
        case WSAEADDRNOTAVAIL: return " (`ipconfig` shows those that this host has; 0.0.0.0 means all of them)";
        default: return "";
    }
}

owned_fd new_socket(int family, int type) noexcept {
    auto made = made_ready(::WSASocketW(family, type, 0, nullptr, 0, WSA_FLAG_OVERLAPPED));
    if (!made || type != SOCK_DGRAM) return made;
    // A datagram to a port without a socket must not fail the next receive.
    BOOL no = FALSE;
    DWORD ignored = 0;
    ::WSAIoctl(number_of(made.get()), SIO_UDP_CONNRESET, &no, sizeof no, nullptr, 0, &ignored, nullptr, nullptr);
    return made;
}

std::pair<std::error_code, owned_fd> accept_from(int listening) noexcept {
    for (;;) {
        auto made = made_ready(::accept(number_of(listening), nullptr, nullptr));
        if (made) return {std::error_code(), std::move(made)};
        auto problem = last_system_error();
        if (problem != asio::error::connection_aborted && problem != asio::error::connection_reset)
            return {problem, owned_fd()};
    }
}

std::error_code begin_to_connect(int socket, const sockaddr* to, socklen_t size) noexcept {
    if (::connect(number_of(socket), to, size) == 0) return {};
    auto problem = last_system_error();
    return problem == asio::error::would_block ? make_error_code(asio::error::in_progress) : problem;
}

std::error_code pending_error(int socket) noexcept {
    int wrong = 0, size = sizeof wrong;
    if (::getsockopt(number_of(socket), SOL_SOCKET, SO_ERROR, reinterpret_cast<char*>(&wrong), &size) != 0)
        return last_system_error();
    return {wrong, asio::error::get_system_category()};
}

// A port in TIME_WAIT is free here without asking; SO_REUSEADDR would take one that another program listens on.
std::error_code claim_port(int socket) noexcept {
    const BOOL yes = TRUE;
    if (::setsockopt(number_of(socket), SOL_SOCKET, SO_EXCLUSIVEADDRUSE, reinterpret_cast<const char*>(&yes),
                     sizeof yes) != 0)
        return last_system_error();
    return {};
}

void set_option(int socket, int level, int name, int value) noexcept {
    ::setsockopt(number_of(socket), level, name, reinterpret_cast<const char*>(&value), sizeof value);
}

transfer receive_bytes(int socket, asio::mutable_buffer into) noexcept {
    WSABUF room{static_cast<ULONG>(std::min<std::size_t>(into.size(), 1u << 30)), static_cast<char*>(into.data())};
    DWORD count = 0, flags = 0;
    const int code = ::WSARecv(number_of(socket), &room, 1, &count, &flags, nullptr, nullptr);
    auto got = outcome_of(code, count);
    if (!got.problem && got.bytes == 0) got.problem = asio::error::eof;
    return got;
}

transfer receive_passed(int socket, asio::mutable_buffer into, std::vector<owned_fd>&) {
    return receive_bytes(socket, into); // nothing is passed here
}

transfer send_bytes(int socket, std::span<const asio::const_buffer> from) noexcept {
    std::array<WSABUF, 64> pieces;
    const auto count = std::min(from.size(), pieces.size());
    for (std::size_t i = 0; i < count; ++i)
        pieces[i] = {static_cast<ULONG>(std::min<std::size_t>(from[i].size(), 1u << 30)),
                     static_cast<char*>(const_cast<void*>(from[i].data()))};
    DWORD sent = 0;
    const int code = ::WSASend(number_of(socket), pieces.data(), static_cast<DWORD>(count), &sent, 0, nullptr, nullptr);
    return outcome_of(code, sent);
}

// The next best: what waits in the system, sent or not.
void limit_unsent_bytes(int socket, std::size_t most) noexcept {
    set_option(socket, SOL_SOCKET, SO_SNDBUF, static_cast<int>(std::clamp<std::size_t>(most, 1, 1u << 30)));
}

void end_sending(int socket) noexcept { ::shutdown(number_of(socket), SD_SEND); }

transfer receive_datagram(int socket, asio::mutable_buffer into, sockaddr* from, socklen_t& size) noexcept {
    const auto most = static_cast<int>(std::min<std::size_t>(into.size(), 1u << 30));
    const int count = ::recvfrom(number_of(socket), static_cast<char*>(into.data()), most, 0, from, &size);
    if (count < 0) return {last_system_error(), 0};
    return {{}, static_cast<std::size_t>(count)};
}

std::error_code send_datagram(int socket, bytes_view content, const sockaddr* to, socklen_t size) noexcept {
    const auto* bytes = reinterpret_cast<const char*>(content.data());
    if (::sendto(number_of(socket), bytes, static_cast<int>(content.size()), 0, to, size) >= 0) return {};
    return last_system_error();
}

std::optional<std::uint32_t> user_of_peer(int) noexcept { return std::nullopt; }

} // namespace ise::real
