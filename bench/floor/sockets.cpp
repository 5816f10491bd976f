#include "sockets.hpp"

#include <arpa/inet.h>
#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <stdexcept>
#include <sys/socket.h>
#include <sys/un.h>
#include <system_error>
#include <unistd.h>
#include <vector>

namespace bench {
namespace {

[[noreturn]] void fail(const char* what) { throw std::system_error(errno, std::system_category(), what); }

int check(int outcome, const char* what) {
    if (outcome < 0) fail(what);
    return outcome;
}

void set_no_delay(int raw) {
    const int on = 1;
    check(::setsockopt(raw, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on), "TCP_NODELAY");
}

std::pair<sockaddr_un, socklen_t> abstract_address(const std::string& name) {
    sockaddr_un out{};
    out.sun_family = AF_UNIX;
    if (name.empty() || name.size() >= sizeof out.sun_path) throw std::invalid_argument("not a local address: " + name);
    std::memcpy(out.sun_path + 1, name.data(), name.size()); // the leading zero: no file
    return {out, static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + name.size())};
}

bool peer_gone() { return errno == ECONNRESET || errno == EPIPE; }

} // namespace

fd::~fd() {
    if (raw_ >= 0) ::close(raw_);
}

std::pair<fd, std::string> listen_on(const std::string& transport) {
    if (transport == "local") {
        fd out(check(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0), "socket"));
        const auto name = "ise-bench-" + std::to_string(::getpid());
        const auto [address, size] = abstract_address(name);
        check(::bind(out.get(), reinterpret_cast<const sockaddr*>(&address), size), "bind");
        check(::listen(out.get(), 64), "listen");
        return {std::move(out), name};
    }
    const bool datagrams = transport == "udp";
    fd out(check(::socket(AF_INET, (datagrams ? SOCK_DGRAM : SOCK_STREAM) | SOCK_CLOEXEC, 0), "socket"));
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof address;
    check(::bind(out.get(), reinterpret_cast<const sockaddr*>(&address), size), "bind");
    if (!datagrams) check(::listen(out.get(), 64), "listen");
    check(::getsockname(out.get(), reinterpret_cast<sockaddr*>(&address), &size), "getsockname");
    return {std::move(out), std::to_string(ntohs(address.sin_port))};
}

fd accept_from(const fd& listener, const std::string& transport) {
    fd out(check(::accept4(listener.get(), nullptr, nullptr, SOCK_CLOEXEC), "accept"));
    if (transport == "tcp") set_no_delay(out.get());
    return out;
}

fd connect_to(const std::string& transport, const std::string& address) {
    if (transport == "local") {
        fd out(check(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0), "socket"));
        const auto [target, size] = abstract_address(address);
        check(::connect(out.get(), reinterpret_cast<const sockaddr*>(&target), size), "connect");
        return out;
    }
    const bool datagrams = transport == "udp";
    fd out(check(::socket(AF_INET, (datagrams ? SOCK_DGRAM : SOCK_STREAM) | SOCK_CLOEXEC, 0), "socket"));
    sockaddr_in target{};
    target.sin_family = AF_INET;
    target.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    target.sin_port = htons(static_cast<std::uint16_t>(std::stoul(address)));
    check(::connect(out.get(), reinterpret_cast<const sockaddr*>(&target), sizeof target), "connect");
    if (!datagrams) set_no_delay(out.get());
    return out;
}

void set_non_blocking(const fd& socket) { check(::fcntl(socket.get(), F_SETFL, O_NONBLOCK), "O_NONBLOCK"); }

void echo_datagrams(const fd& socket) {
    std::vector<char> content(64 * 1024);
    for (;;) {
        sockaddr_in from{};
        socklen_t size = sizeof from;
        const auto got =
            ::recvfrom(socket.get(), content.data(), content.size(), 0, reinterpret_cast<sockaddr*>(&from), &size);
        if (got < 0 && errno != EINTR && !peer_gone()) fail("recvfrom");
        if (got >= 0)
            ::sendto(socket.get(), content.data(), static_cast<std::size_t>(got), MSG_NOSIGNAL,
                     reinterpret_cast<const sockaddr*>(&from), size);
    }
}

bool read_exactly(const fd& socket, char* out, std::size_t size) {
    while (size != 0) {
        const auto got = ::read(socket.get(), out, size);
        if (got == 0) return false;
        if (got < 0) {
            if (errno == EINTR) continue;
            if (peer_gone()) return false;
            fail("read");
        }
        out += got;
        size -= static_cast<std::size_t>(got);
    }
    return true;
}

bool write_all(const fd& socket, const char* data, std::size_t size) {
    while (size != 0) {
        const auto sent = ::send(socket.get(), data, size, MSG_NOSIGNAL);
        if (sent < 0) {
            if (errno == EINTR) continue;
            if (peer_gone()) return false;
            fail("send");
        }
        data += sent;
        size -= static_cast<std::size_t>(sent);
    }
    return true;
}

} // namespace bench
