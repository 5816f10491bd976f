#include "floors.hpp"
#include "sockets.hpp"

#include <algorithm>
#include <cerrno>
#include <poll.h>
#include <stdexcept>
#include <sys/socket.h>
#include <system_error>
#include <unistd.h>
#include <vector>

namespace bench {
namespace {

constexpr std::size_t chunk_bytes = 256 * 1024;

[[noreturn]] void server_gone() { throw std::runtime_error("the serving side closed the connection"); }

outcome one_at_a_time(const options& asked, const fd& socket) {
    std::vector<char> message(asked.size_bytes);
    outcome out;
    const auto begin = now_ns() + static_cast<std::int64_t>(asked.warmup_seconds * 1e9);
    const auto end = begin + static_cast<std::int64_t>(asked.seconds * 1e9);
    for (auto before = now_ns(); before < end;) {
        if (!write_all(socket, message.data(), message.size())) server_gone();
        if (!read_exactly(socket, message.data(), message.size())) server_gone();
        const auto after = now_ns();
        if (before >= begin) {
            out.latency.add(after - before);
            out.seconds += static_cast<double>(after - before) * 1e-9;
        }
        before = after;
    }
    out.count = out.latency.samples();
    return out;
}

/// Keeps `outstanding` messages on the way: as many as came back in one read go out again in one write.
outcome pipelined(const options& asked, const fd& socket) {
    set_non_blocking(socket);
    const std::vector<char> requests(std::min(asked.outstanding * asked.size_bytes, std::max(chunk_bytes, asked.size_bytes)));
    std::vector<char> replies(chunk_bytes);
    auto to_send = asked.outstanding * asked.size_bytes;
    std::size_t received = 0; // bytes of replies that are not whole yet
    outcome out;
    auto now = now_ns();
    const auto begin = now + static_cast<std::int64_t>(asked.warmup_seconds * 1e9);
    const auto end = begin + static_cast<std::int64_t>(asked.seconds * 1e9);
    std::int64_t counted_since = 0;
    while (now < end || counted_since == 0) {
        bool moved = false;
        if (to_send != 0) {
            const auto sent = ::send(socket.get(), requests.data(), std::min(to_send, requests.size()), MSG_NOSIGNAL);
            if (sent > 0) {
                to_send -= static_cast<std::size_t>(sent);
                moved = true;
            } else if (errno != EAGAIN && errno != EINTR) {
                server_gone();
            }
        }
        const auto got = ::read(socket.get(), replies.data(), replies.size());
        if (got > 0) {
            received += static_cast<std::size_t>(got);
            const auto whole = received / asked.size_bytes;
            received -= whole * asked.size_bytes;
            to_send += whole * asked.size_bytes;
            now = now_ns();
            if (counted_since != 0) out.count += whole;
            else if (now >= begin) counted_since = now;
            moved = true;
        } else if (got == 0 || (errno != EAGAIN && errno != EINTR)) {
            server_gone();
        }
        if (!moved) {
            pollfd wait{socket.get(), static_cast<short>(to_send != 0 ? POLLIN | POLLOUT : POLLIN), 0};
            ::poll(&wait, 1, 1000);
            now = now_ns();
        }
    }
    out.seconds = static_cast<double>(now - counted_since) * 1e-9;
    return out;
}

} // namespace

void serve_raw_call(const options& asked) {
    auto [listener, address] = listen_on(asked.transport);
    announce(address);
    for (;;) {
        const auto socket = accept_from(listener, asked.transport);
        // A single call is read whole and answered; of many outstanding whatever has come goes back in one write.
        std::vector<char> buffer(asked.outstanding == 1 ? asked.size_bytes : chunk_bytes);
        if (asked.outstanding == 1) {
            while (read_exactly(socket, buffer.data(), buffer.size()) && write_all(socket, buffer.data(), buffer.size())) {
            }
        } else {
            for (;;) {
                const auto got = ::read(socket.get(), buffer.data(), buffer.size());
                if (got <= 0 || !write_all(socket, buffer.data(), static_cast<std::size_t>(got))) break;
            }
        }
    }
}

outcome raw_call(const options& asked) {
    const auto socket = connect_to(asked.transport, asked.connect);
    return asked.outstanding == 1 ? one_at_a_time(asked, socket) : pipelined(asked, socket);
}

} // namespace bench
