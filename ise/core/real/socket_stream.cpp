#include <ise/core/real/socket_stream.hpp>

#include <asio/error.hpp>
#include <asio/ip/tcp.hpp>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>

#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/uio.h>

namespace ise::real {
namespace {

int family_of(int fd) noexcept {
    sockaddr_storage here{};
    socklen_t size = sizeof here;
    return ::getsockname(fd, reinterpret_cast<sockaddr*>(&here), &size) == 0 ? here.ss_family : AF_UNSPEC;
}

} // namespace

owned_fd new_socket(int family, int type) noexcept {
    return owned_fd(::socket(family, type | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
}

socket_stream::socket_stream(loop& on, owned_fd fd, std::string peer)
    : descriptor(on, std::move(fd)), peer_(std::move(peer)),
      reader_(on,
              [this] {
                  reader_.resume({asio::error::operation_aborted, 0});
              }),
      writable_(on, [this] { writable_.resume({asio::error::operation_aborted}); }) {
    const int yes = 1; // a local socket has none; one that died already says so at its first read
    ::setsockopt(this->fd(), IPPROTO_TCP, TCP_NODELAY, &yes, sizeof yes);
}

std::pair<std::error_code, std::unique_ptr<stream>> socket_stream::of(loop& on, owned_fd connected, std::string peer) {
    auto made = std::make_unique<socket_stream>(on, std::move(connected), std::move(peer));
    if (auto problem = made->watch()) return {problem, nullptr};
    return {std::error_code(), std::move(made)};
}

task<std::pair<std::error_code, std::unique_ptr<stream>>> socket_stream::connect(loop& on, sockaddr_storage to,
                                                                                 socklen_t size, std::string peer) {
    using connected = std::pair<std::error_code, std::unique_ptr<stream>>;
    auto fd = new_socket(to.ss_family, SOCK_STREAM);
    if (!fd) co_return connected(last_system_error(), nullptr);
    std::error_code problem;
    // Interrupted, it goes on as well.
    if (::connect(fd.get(), reinterpret_cast<sockaddr*>(&to), size) != 0) problem = last_system_error();
    const bool pending = problem.value() == EINPROGRESS || problem.value() == EINTR;
    if (problem && !pending) co_return connected(problem, nullptr);
    // Before it connects epoll would tell that it is not connected.
    auto made = std::make_unique<socket_stream>(on, std::move(fd), std::move(peer));
    problem = made->watch();
    if (!problem && pending) {
        problem = co_await made->wait_writable();
        int wrong = 0;
        socklen_t room = sizeof wrong;
        if (!problem && ::getsockopt(made->fd(), SOL_SOCKET, SO_ERROR, &wrong, &room) != 0)
            problem = last_system_error();
        if (!problem && wrong != 0) problem = std::error_code(wrong, asio::error::get_system_category());
    }
    if (problem) made.reset();
    co_return connected(problem, std::move(made));
}

// What comes is read where it is told, into the memory of who waits: the coroutine touches nothing of the stream
// afterwards, which may be gone by then.
task<transfer> socket_stream::read_some(asio::mutable_buffer into) {
    if (!fd_open()) co_return transfer{asio::error::operation_aborted, 0};
    if (into.size() == 0) co_return transfer{};
    if (!deliver_to_ && may_read()) {
        auto got = read(into);
        if (got.problem != asio::error::would_block) co_return got;
    }
    into_ = into;
    want_read();
    auto got = co_await reader_.wait();
    co_return got;
}

bool socket_stream::deliver_to(stream_reader& reader) {
    deliver_to_ = &reader;
    want_read();
    return true;
}

void socket_stream::deliver() {
    while (may_read()) {
        const auto room = deliver_to_->room();
        if (room.size() == 0) return;
        const auto got = read(room);
        if (got.problem == asio::error::would_block) break;
        deliver_to_->on_bytes(got);
        if (got.problem || !fd_open()) return;
    }
    want_read();
}

void socket_stream::on_readable() {
    if (deliver_to_) return deliver();
    if (!reader_.waiting() || !may_read()) return;
    auto got = read(into_);
    if (got.problem == asio::error::would_block) want_read();
    else reader_.resume(got);
}

transfer socket_stream::read(asio::mutable_buffer into) {
    for (;;) {
        const auto count = passed_ ? receive(into) : ::recv(fd(), into.data(), into.size(), 0);
        if (count > 0) {
            if (static_cast<std::size_t>(count) < into.size()) found_less();
            return {{}, static_cast<std::size_t>(count)};
        }
        if (count == 0) return {asio::error::eof, 0};
        if (errno == EINTR) continue;
        if (errno != EAGAIN && errno != EWOULDBLOCK) return {last_system_error(), 0};
        found_nothing();
        return {asio::error::would_block, 0};
    }
}

// With descriptors: those beyond the room for them are closed by the system.
std::ptrdiff_t socket_stream::receive(asio::mutable_buffer into) {
    constexpr std::size_t most = 8;
    alignas(cmsghdr) std::array<char, CMSG_SPACE(most * sizeof(int))> room{};
    iovec content{into.data(), into.size()};
    msghdr message{};
    message.msg_iov = &content;
    message.msg_iovlen = 1;
    message.msg_control = room.data();
    message.msg_controllen = room.size();
    const auto count = ::recvmsg(fd(), &message, MSG_CMSG_CLOEXEC);
    if (count < 0) return count;
    for (auto* head = CMSG_FIRSTHDR(&message); head; head = CMSG_NXTHDR(&message, head)) {
        if (head->cmsg_level != SOL_SOCKET || head->cmsg_type != SCM_RIGHTS) continue;
        for (std::size_t at = CMSG_LEN(0); at + sizeof(int) <= head->cmsg_len; at += sizeof(int)) {
            int made = -1;
            std::memcpy(&made, reinterpret_cast<const char*>(head) + at, sizeof made);
            passed_->emplace_back(made);
        }
    }
    return count;
}

// Also from another thread: signs of life.
transfer socket_stream::try_write(std::span<const asio::const_buffer> from) {
    iovec pieces[64];
    msghdr message{};
    message.msg_iov = pieces;
    message.msg_iovlen = std::min(from.size(), std::size(pieces));
    for (std::size_t i = 0; i < message.msg_iovlen; ++i)
        pieces[i] = {const_cast<void*>(from[i].data()), from[i].size()};
    for (;;) {
        // A single piece goes without the list of pieces, which the system would copy and check.
        const auto written = from.size() == 1
                                 ? ::send(fd(), from[0].data(), from[0].size(), MSG_NOSIGNAL | MSG_DONTWAIT)
                                 : ::sendmsg(fd(), &message, MSG_NOSIGNAL | MSG_DONTWAIT);
        if (written >= 0) return {{}, static_cast<std::size_t>(written)};
        if (errno == EINTR) continue;
        if (errno == EAGAIN || errno == EWOULDBLOCK) return {asio::error::would_block, 0};
        return {last_system_error(), 0};
    }
}

task<std::error_code> socket_stream::wait_writable() {
    if (!fd_open()) co_return asio::error::operation_aborted;
    if (auto problem = want_write()) co_return problem;
    auto ended = co_await writable_.wait();
    co_return ended.problem;
}

void socket_stream::limit_unsent(std::size_t most) {
    auto bytes_waiting = static_cast<int>(std::clamp<std::size_t>(most, 1, 1u << 30));
    ::setsockopt(fd(), IPPROTO_TCP, TCP_NOTSENT_LOWAT, &bytes_waiting, sizeof bytes_waiting); // a local one has none
}

void socket_stream::shutdown_write() { ::shutdown(fd(), SHUT_WR); } // not connected any more: the reader learns it

void socket_stream::close() {
    if (!fd_open()) return;
    close_descriptor();
    reader_.resume({asio::error::operation_aborted, 0});
    writable_.resume({asio::error::operation_aborted});
}

std::optional<ucred> credentials_of_peer(int socket) noexcept {
    ucred made{};
    socklen_t size = sizeof made;
    if (family_of(socket) != AF_UNIX) return std::nullopt; // others have an answer without meaning
    if (::getsockopt(socket, SOL_SOCKET, SO_PEERCRED, &made, &size) != 0 || size != sizeof made) return std::nullopt;
    return made;
}

void socket_stream::add_verified(verified_peer& to) const {
    if (auto peer = credentials_of_peer(fd())) to.user = peer->uid;
}

std::optional<endpoint> socket_stream::local() const {
    asio::ip::tcp::endpoint here;
    socklen_t size = static_cast<socklen_t>(here.capacity());
    if (::getsockname(fd(), here.data(), &size) != 0) return std::nullopt;
    if (here.data()->sa_family != AF_INET && here.data()->sa_family != AF_INET6) return std::nullopt;
    return endpoint{protocol::tcp, here.address().to_string(), here.port(), {}};
}

socket_acceptor::socket_acceptor(loop& on, owned_fd listening)
    : descriptor(on, std::move(listening)),
      waiting_(on, [this] { waiting_.resume(accepted(asio::error::operation_aborted, owned_fd())); }) {}

task<socket_acceptor::accepted> socket_acceptor::accept() {
    if (!fd_open()) co_return accepted(asio::error::operation_aborted, owned_fd());
    if (may_read()) {
        auto taken = take();
        if (taken.first != asio::error::would_block) co_return taken;
    }
    want_read();
    auto taken = co_await waiting_.wait();
    co_return taken;
}

void socket_acceptor::close() noexcept {
    if (!fd_open()) return;
    close_descriptor();
    waiting_.resume(accepted(asio::error::operation_aborted, owned_fd()));
}

void socket_acceptor::on_readable() {
    if (!waiting_.waiting() || !may_read()) return;
    auto taken = take();
    if (taken.first == asio::error::would_block) want_read();
    else waiting_.resume(std::move(taken));
}

// A stranger who has left already makes room for the next. Out of descriptors, it stays ready: there is no other
// event for those who wait.
socket_acceptor::accepted socket_acceptor::take() {
    for (;;) {
        owned_fd made(::accept4(fd(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
        if (made) return {std::error_code(), std::move(made)};
        if (errno == EINTR || errno == ECONNABORTED) continue;
        if (errno != EAGAIN && errno != EWOULDBLOCK) return {last_system_error(), owned_fd()};
        found_nothing();
        return {asio::error::would_block, owned_fd()};
    }
}

} // namespace ise::real
