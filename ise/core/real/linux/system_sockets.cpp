#include <ise/core/real/system_sockets.hpp>

#include <ise/core/real/linux/local_peer.hpp>
#include <ise/core/real/system_errors.hpp>

#include <asio/buffer.hpp>
#include <asio/error.hpp>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>

#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/uio.h>
#include <unistd.h>

namespace ise::real {
namespace {

int family_of(int fd) noexcept {
    sockaddr_storage here{};
    socklen_t size = sizeof here;
    return ::getsockname(fd, reinterpret_cast<sockaddr*>(&here), &size) == 0 ? here.ss_family : AF_UNSPEC;
}

std::error_code last_or_would_block() noexcept {
    if (errno == EAGAIN || errno == EWOULDBLOCK) return asio::error::would_block;
    return last_system_error();
}

// The outcome of a call that reads or writes; empty: it was interrupted.
std::optional<transfer> outcome_of(std::ptrdiff_t count) noexcept {
    if (count >= 0) return transfer{{}, static_cast<std::size_t>(count)};
    if (errno == EINTR) return std::nullopt;
    return transfer{last_or_would_block(), 0};
}

transfer end_if_empty(transfer got) noexcept {
    if (!got.problem && got.bytes == 0) got.problem = asio::error::eof;
    return got;
}

// Descriptors beyond the room for them are closed by the system.
std::ptrdiff_t receive_with(int socket, asio::mutable_buffer into, std::vector<owned_fd>& passed) {
    constexpr std::size_t most = 8;
    alignas(cmsghdr) std::array<char, CMSG_SPACE(most * sizeof(int))> room{};
    iovec content{into.data(), into.size()};
    msghdr message{};
    message.msg_iov = &content;
    message.msg_iovlen = 1;
    message.msg_control = room.data();
    message.msg_controllen = room.size();
    const auto count = ::recvmsg(socket, &message, MSG_CMSG_CLOEXEC);
    if (count < 0) return count;
    for (auto* head = CMSG_FIRSTHDR(&message); head; head = CMSG_NXTHDR(&message, head)) {
        if (head->cmsg_level != SOL_SOCKET || head->cmsg_type != SCM_RIGHTS) continue;
        for (std::size_t at = CMSG_LEN(0); at + sizeof(int) <= head->cmsg_len; at += sizeof(int)) {
            int made = -1;
            std::memcpy(&made, reinterpret_cast<const char*>(head) + at, sizeof made);
            passed.emplace_back(made);
        }
    }
    return count;
}

} // namespace

void owned_fd::reset(int fd) noexcept {
    if (fd_ >= 0) ::close(fd_);
    fd_ = fd;
}

std::error_code last_system_error() noexcept { return {errno, asio::error::get_system_category()}; }

bool is_address_taken(const std::error_code& why) noexcept { return why.value() == EADDRINUSE; }

bool is_out_of_descriptors(const std::error_code& why) noexcept {
    return why.value() == EMFILE || why.value() == ENFILE;
}

bool is_out_of_memory(const std::error_code& why) noexcept { return why.value() == ENOMEM || why.value() == ENOBUFS; }

std::string_view advice_on(const std::error_code& why) noexcept {
    switch (why.value()) {
        case EADDRINUSE: return " (`ss -lntuxp` shows the program: end it, or use another endpoint)";
        case EMFILE:
        case ENFILE: return " (`ulimit -n` shows how many this process may have: raise that)";
        case EADDRNOTAVAIL: return " (`ip address` shows those that this host has; 0.0.0.0 means all of them)";
        default: return "";
    }
}

owned_fd new_socket(int family, int type) noexcept {
    return owned_fd(::socket(family, type | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
}

std::pair<std::error_code, owned_fd> accept_from(int listening) noexcept {
    for (;;) {
        owned_fd made(::accept4(listening, nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
        if (made) return {std::error_code(), std::move(made)};
        if (errno == EINTR || errno == ECONNABORTED) continue;
        return {last_or_would_block(), owned_fd()};
    }
}

std::error_code begin_to_connect(int socket, const sockaddr* to, socklen_t size) noexcept {
    if (::connect(socket, to, size) == 0) return {};
    if (errno == EINTR) return asio::error::in_progress; // it goes on as well
    return last_system_error();
}

std::error_code pending_error(int socket) noexcept {
    int wrong = 0;
    socklen_t room = sizeof wrong;
    if (::getsockopt(socket, SOL_SOCKET, SO_ERROR, &wrong, &room) != 0) return last_system_error();
    return {wrong, asio::error::get_system_category()};
}

std::error_code claim_port(int socket) noexcept {
    const int yes = 1;
    if (::setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes) != 0) return last_system_error();
    return {};
}

void set_option(int socket, int level, int name, int value) noexcept {
    ::setsockopt(socket, level, name, &value, sizeof value);
}

[[gnu::hot]] transfer receive_bytes(int socket, asio::mutable_buffer into) noexcept {
    for (;;)
        if (auto got = outcome_of(::recv(socket, into.data(), into.size(), 0))) return end_if_empty(*got);
}

transfer receive_passed(int socket, asio::mutable_buffer into, std::vector<owned_fd>& passed) {
    for (;;)
        if (auto got = outcome_of(receive_with(socket, into, passed))) return end_if_empty(*got);
}

// A single piece goes without the list of pieces, which the system would copy and check.
[[gnu::hot]] transfer send_bytes(int socket, std::span<const asio::const_buffer> from) noexcept {
    constexpr int flags = MSG_NOSIGNAL | MSG_DONTWAIT;
    if (from.size() == 1)
        for (;;)
            if (auto sent = outcome_of(::send(socket, from[0].data(), from[0].size(), flags))) return *sent;
    iovec pieces[64];
    msghdr message{};
    message.msg_iov = pieces;
    message.msg_iovlen = std::min(from.size(), std::size(pieces));
    for (std::size_t i = 0; i < message.msg_iovlen; ++i)
        pieces[i] = {const_cast<void*>(from[i].data()), from[i].size()};
    for (;;)
        if (auto sent = outcome_of(::sendmsg(socket, &message, flags))) return *sent;
}

void limit_unsent_bytes(int socket, std::size_t most) noexcept { // a local one has none
    set_option(socket, IPPROTO_TCP, TCP_NOTSENT_LOWAT, static_cast<int>(std::clamp<std::size_t>(most, 1, 1u << 30)));
}

void end_sending(int socket) noexcept { ::shutdown(socket, SHUT_WR); }

transfer receive_datagram(int socket, asio::mutable_buffer into, sockaddr* from, socklen_t& size) noexcept {
    for (;;)
        if (auto got = outcome_of(::recvfrom(socket, into.data(), into.size(), 0, from, &size))) return *got;
}

[[gnu::hot]] std::error_code send_datagram(int socket, bytes_view content, const sockaddr* to,
                                           socklen_t size) noexcept {
    constexpr int flags = MSG_NOSIGNAL | MSG_DONTWAIT;
    for (;;)
        if (auto sent = outcome_of(::sendto(socket, content.data(), content.size(), flags, to, size)))
            return sent->problem;
}

std::optional<ucred> credentials_of_peer(int socket) noexcept {
    ucred made{};
    socklen_t size = sizeof made;
    if (family_of(socket) != AF_UNIX) return std::nullopt; // others have an answer without meaning
    if (::getsockopt(socket, SOL_SOCKET, SO_PEERCRED, &made, &size) != 0 || size != sizeof made) return std::nullopt;
    return made;
}

std::optional<std::uint32_t> user_of_peer(int socket) noexcept {
    auto peer = credentials_of_peer(socket);
    return peer ? std::optional<std::uint32_t>(peer->uid) : std::nullopt;
}

} // namespace ise::real
