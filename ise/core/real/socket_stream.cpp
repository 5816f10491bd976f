#include <ise/core/real/socket_stream.hpp>

#include <asio/buffer.hpp>
#include <asio/error.hpp>
#include <asio/ip/tcp.hpp>

#include <algorithm>
#include <cstring>

namespace ise::real {

socket_stream::socket_stream(loop& on, owned_fd fd, std::string peer)
    : descriptor(on, std::move(fd)), peer_(std::move(peer)), reader_(on), writable_(on) {
    // A local socket has none; one that died already says so at its first read.
    set_option(this->fd(), IPPROTO_TCP, TCP_NODELAY, 1);
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
    auto problem = begin_to_connect(fd.get(), reinterpret_cast<sockaddr*>(&to), size);
    const bool pending = problem == asio::error::in_progress;
    if (problem && !pending) co_return connected(problem, nullptr);
    // Before it connects epoll would tell that it is not connected.
    auto made = std::make_unique<socket_stream>(on, std::move(fd), std::move(peer));
    problem = made->watch();
    if (!problem && pending) {
        problem = co_await made->wait_writable();
        if (!problem) problem = pending_error(made->fd());
    }
    if (problem) made.reset();
    co_return connected(problem, std::move(made));
}

// What comes is read where it is told, into the memory of who waits: the coroutine touches nothing of the stream
// afterwards, which may be gone by then.
task<transfer> socket_stream::read_some(asio::mutable_buffer into) {
    if (!fd_open()) co_return transfer{asio::error::operation_aborted, 0};
    if (into.size() == 0) co_return transfer{};
    if (may_read()) {
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

[[gnu::hot]] void socket_stream::deliver() {
    std::size_t delivered = 0;
    while (delivered < stream_reader::turn_bytes && may_read()) {
        const auto room = deliver_to_->room();
        if (room.size() == 0) return;
        const auto got = read(room);
        if (got.problem && got.problem == asio::error::would_block) break;
        deliver_to_->on_bytes(got);
        if (got.problem || !fd_open()) return;
        delivered += got.bytes;
    }
    if (!is_received_for_after(delivered < short_bytes)) want_read();
}

[[gnu::hot]] void socket_stream::on_received(const received& what) {
    for (auto content = what.content; !content.empty();) {
        const auto room = deliver_to_->room();
        const auto some = content.first(std::min(content.size(), room.size()));
        if (some.empty()) return;
        std::memcpy(room.data(), some.data(), some.size());
        deliver_to_->on_bytes({std::error_code(), some.size()});
        if (!fd_open()) return;
        content = content.subspan(some.size());
    }
}

void socket_stream::on_receive_failure(const std::error_code& problem) { deliver_to_->on_bytes({problem, 0}); }

[[gnu::hot]] void socket_stream::on_readable() {
    if (deliver_to_) return deliver();
    if (!reader_.waiting() || !may_read()) return;
    auto got = read(into_);
    if (got.problem == asio::error::would_block) want_read();
    else reader_.resume(got);
}

[[gnu::hot]] transfer socket_stream::read(asio::mutable_buffer into) {
    auto got = passed_ ? receive_passed(fd(), into, *passed_) : receive_bytes(fd(), into);
    if (got.problem) [[unlikely]] {
        if (got.problem == asio::error::would_block) found_nothing();
    } else if (got.bytes < into.size() && !passed_) { // such a read stops behind each descriptor
        found_less();
    }
    return got;
}

// Also from another thread: signs of life.
[[gnu::hot]] transfer socket_stream::try_write(std::span<const asio::const_buffer> from) {
    return send_bytes(fd(), from);
}

task<std::error_code> socket_stream::wait_writable() {
    if (!fd_open()) co_return asio::error::operation_aborted;
    if (auto problem = want_write()) co_return problem;
    auto ended = co_await writable_.wait();
    co_return ended.problem;
}

void socket_stream::limit_unsent(std::size_t most) { limit_unsent_bytes(fd(), most); }

void socket_stream::shutdown_write() { end_sending(fd()); } // not connected any more: the reader learns it

void socket_stream::close() {
    if (!fd_open()) return;
    close_descriptor();
    reader_.resume({asio::error::operation_aborted, 0});
    writable_.resume({asio::error::operation_aborted});
}

void socket_stream::add_verified(verified_peer& to) const {
    if (auto user = user_of_peer(fd())) to.user = user;
}

std::optional<endpoint> socket_stream::local() const {
    asio::ip::tcp::endpoint here;
    socklen_t size = static_cast<socklen_t>(here.capacity());
    if (::getsockname(fd(), here.data(), &size) != 0) return std::nullopt;
    if (here.data()->sa_family != AF_INET && here.data()->sa_family != AF_INET6) return std::nullopt;
    return endpoint{protocol::tcp, here.address().to_string(), here.port(), {}};
}

socket_acceptor::socket_acceptor(loop& on, owned_fd listening) : descriptor(on, std::move(listening)), waiting_(on) {}

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

// Out of descriptors, it stays ready: there is no other event for those who wait.
socket_acceptor::accepted socket_acceptor::take() {
    auto taken = accept_from(fd());
    if (taken.first == asio::error::would_block) found_nothing();
    return taken;
}

} // namespace ise::real
