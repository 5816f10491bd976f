#include "floors.hpp"
#include "sockets.hpp"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <ctime>
#include <poll.h>
#include <stdexcept>
#include <sys/socket.h>
#include <unistd.h>
#include <vector>

namespace bench {

void serve_raw_publish(const options& asked) {
    auto [listener, address] = listen_on(asked.transport);
    announce(address);
    const auto batch_messages = std::max<std::size_t>(1, 64 * 1024 / asked.size_bytes);
    const std::vector<char> batch(batch_messages * asked.size_bytes);
    for (;;) {
        std::vector<fd> subscribers;
        while (subscribers.size() < asked.subscribers) {
            subscribers.push_back(accept_from(listener, asked.transport));
            set_non_blocking(subscribers.back());
        }
        std::vector<pollfd> waits;
        for (const auto& one : subscribers) waits.push_back({one.get(), POLLOUT, 0});
        std::vector<std::size_t> sent(waits.size()); // of the batch
        for (bool alive = true; alive;) {
            ::poll(waits.data(), waits.size(), 1000);
            for (std::size_t i = 0; i != waits.size() && alive; ++i) {
                if (waits[i].revents == 0) continue;
                const auto n = ::send(waits[i].fd, batch.data() + sent[i], batch.size() - sent[i], MSG_NOSIGNAL);
                if (n > 0) sent[i] = (sent[i] + static_cast<std::size_t>(n)) % batch.size();
                else alive = errno == EAGAIN || errno == EINTR;
            }
        }
    }
}

outcome raw_publish(const options& asked) {
    std::vector<fd> sockets;
    std::vector<pollfd> waits;
    for (std::size_t i = 0; i != asked.subscribers; ++i) {
        sockets.push_back(connect_to(asked.transport, asked.connect));
        set_non_blocking(sockets.back());
        waits.push_back({sockets.back().get(), POLLIN, 0});
    }
    std::vector<char> buffer(256 * 1024);
    std::uint64_t bytes = 0;
    auto now = now_ns();
    const auto begin = now + static_cast<std::int64_t>(asked.warmup_seconds * 1e9);
    const auto end = begin + static_cast<std::int64_t>(asked.seconds * 1e9);
    std::int64_t counted_since = 0;
    while (now < end || counted_since == 0) {
        ::poll(waits.data(), waits.size(), 1000);
        for (const auto& wait : waits) {
            if (wait.revents == 0) continue;
            const auto got = ::read(wait.fd, buffer.data(), buffer.size());
            if (got > 0) bytes += static_cast<std::uint64_t>(got);
            else if (got == 0 || (errno != EAGAIN && errno != EINTR)) throw std::runtime_error("the publisher closed the connection");
        }
        now = now_ns();
        if (counted_since == 0 && now >= begin) {
            counted_since = now;
            bytes = 0;
        }
    }
    outcome out;
    out.count = bytes / asked.size_bytes;
    out.seconds = static_cast<double>(now - counted_since) * 1e-9;
    return out;
}

void serve_raw_paced(const options& asked) {
    auto [listener, address] = listen_on(asked.transport);
    announce(address);
    std::vector<char> message(asked.size_bytes);
    for (;;) {
        const auto socket = accept_from(listener, asked.transport);
        for (auto next = now_ns();;) {
            next += 1'000'000;
            const timespec until{static_cast<time_t>(next / 1'000'000'000), static_cast<long>(next % 1'000'000'000)};
            ::clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr);
            const auto stamp = now_ns();
            std::memcpy(message.data(), &stamp, sizeof stamp);
            if (!write_all(socket, message.data(), message.size())) break;
        }
    }
}

outcome raw_paced(const options& asked) {
    const auto socket = connect_to(asked.transport, asked.connect);
    std::vector<char> message(asked.size_bytes);
    outcome out;
    auto now = now_ns();
    const auto begin = now + static_cast<std::int64_t>(asked.warmup_seconds * 1e9);
    const auto end = begin + static_cast<std::int64_t>(asked.seconds * 1e9);
    while (now < end) {
        if (!read_exactly(socket, message.data(), message.size())) throw std::runtime_error("the publisher closed the connection");
        now = now_ns();
        std::int64_t stamp = 0;
        std::memcpy(&stamp, message.data(), sizeof stamp);
        if (now >= begin) out.latency.add(now - stamp);
    }
    out.count = out.latency.samples();
    out.seconds = static_cast<double>(now - begin) * 1e-9;
    return out;
}

} // namespace bench
