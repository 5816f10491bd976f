#include "floors.hpp"
#include "frames.hpp"
#include "sockets.hpp"

#include <cerrno>
#include <poll.h>
#include <stdexcept>
#include <sys/socket.h>
#include <system_error>
#include <unistd.h>
#include <vector>

namespace bench {
namespace {

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
    const std::vector<char> request(asked.size_bytes);
    message_reader reader(asked.size_bytes);
    std::vector<char> unsent;
    std::size_t sent_bytes = 0; // of those
    for (std::size_t i = 0; i != asked.outstanding; ++i) append_message(unsent, request);
    outcome out;
    auto now = now_ns();
    const auto begin = now + static_cast<std::int64_t>(asked.warmup_seconds * 1e9);
    const auto end = begin + static_cast<std::int64_t>(asked.seconds * 1e9);
    std::int64_t counted_since = 0;
    while (now < end || counted_since == 0) {
        bool moved = false;
        if (sent_bytes != unsent.size()) {
            const auto sent =
                ::send(socket.get(), unsent.data() + sent_bytes, unsent.size() - sent_bytes, MSG_NOSIGNAL);
            if (sent > 0) {
                sent_bytes += static_cast<std::size_t>(sent);
                moved = true;
            } else if (errno != EAGAIN && errno != EINTR) {
                server_gone();
            }
            if (sent_bytes > unsent.size() / 2) { // it may never be empty, so drop what has gone
                unsent.erase(unsent.begin(), unsent.begin() + static_cast<std::ptrdiff_t>(sent_bytes));
                sent_bytes = 0;
            }
        }
        const auto got = ::read(socket.get(), reader.space(), reader.space_bytes());
        if (got > 0) {
            const auto whole = reader.take(static_cast<std::size_t>(got),
                                           [&](const char*, std::size_t) { append_message(unsent, request); });
            now = now_ns();
            if (counted_since != 0) out.count += whole;
            else if (now >= begin) counted_since = now;
            moved = true;
        } else if (got == 0 || (errno != EAGAIN && errno != EINTR)) {
            server_gone();
        }
        if (!moved) {
            pollfd wait{socket.get(), static_cast<short>(unsent.empty() ? POLLIN : POLLIN | POLLOUT), 0};
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
    if (asked.transport == "udp") echo_datagrams(listener);
    for (;;) {
        const auto socket = accept_from(listener, asked.transport);
        if (asked.outstanding == 1) {
            std::vector<char> message(asked.size_bytes);
            while (read_exactly(socket, message.data(), message.size()) &&
                   write_all(socket, message.data(), message.size())) {}
            continue;
        }
        // Of many outstanding, all that came whole in one read is answered in one write.
        message_reader reader(asked.size_bytes);
        const std::vector<char> reply(asked.size_bytes);
        for (std::vector<char> replies;; replies.clear()) {
            const auto got = ::read(socket.get(), reader.space(), reader.space_bytes());
            if (got <= 0) break;
            reader.take(static_cast<std::size_t>(got),
                        [&](const char*, std::size_t) { append_message(replies, reply); });
            if (!write_all(socket, replies.data(), replies.size())) break;
        }
    }
}

outcome raw_call(const options& asked) {
    const auto socket = connect_to(asked.transport, asked.connect);
    return asked.outstanding == 1 ? one_at_a_time(asked, socket) : pipelined(asked, socket);
}

} // namespace bench
