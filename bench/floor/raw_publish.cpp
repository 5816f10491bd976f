#include "floors.hpp"
#include "frames.hpp"
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
    const std::vector<char> message(asked.size_bytes);
    std::vector<char> batch;
    for (;;) {
        std::vector<fd> subscribers;
        std::vector<pollfd> waits;
        while (subscribers.size() < asked.subscribers) {
            subscribers.push_back(accept_from(listener, asked.transport));
            set_non_blocking(subscribers.back());
            waits.push_back({subscribers.back().get(), POLLOUT, 0});
        }
        // A batch is assembled once for all and sent to each before the next one.
        std::vector<std::size_t> sent(waits.size());
        for (bool alive = true; alive;) {
            batch.clear();
            for (std::size_t i = 0; i != batch_messages; ++i) append_message(batch, message);
            std::fill(sent.begin(), sent.end(), 0);
            for (auto left = waits.size(); left != 0 && alive;) {
                ::poll(waits.data(), waits.size(), 1000);
                for (std::size_t i = 0; i != waits.size() && alive; ++i) {
                    if (waits[i].revents == 0 || sent[i] == batch.size()) continue;
                    const auto n = ::send(waits[i].fd, batch.data() + sent[i], batch.size() - sent[i], MSG_NOSIGNAL);
                    if (n > 0) sent[i] += static_cast<std::size_t>(n);
                    else alive = errno == EAGAIN || errno == EINTR;
                    if (sent[i] == batch.size()) {
                        --left;
                        waits[i].fd = -waits[i].fd; // poll looks away from it
                    }
                }
            }
            for (auto& wait : waits) wait.fd = wait.fd < 0 ? -wait.fd : wait.fd;
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
    std::vector<message_reader> readers(asked.subscribers, message_reader(asked.size_bytes));
    outcome out;
    auto now = now_ns();
    const auto begin = now + static_cast<std::int64_t>(asked.warmup_seconds * 1e9);
    const auto end = begin + static_cast<std::int64_t>(asked.seconds * 1e9);
    std::int64_t counted_since = 0;
    while (now < end || counted_since == 0) {
        ::poll(waits.data(), waits.size(), 1000);
        for (std::size_t i = 0; i != waits.size(); ++i) {
            if (waits[i].revents == 0) continue;
            const auto got = ::read(waits[i].fd, readers[i].space(), readers[i].space_bytes());
            if (got > 0) out.count += readers[i].take(static_cast<std::size_t>(got), [](const char*, std::size_t) {});
            else if (got == 0 || (errno != EAGAIN && errno != EINTR))
                throw std::runtime_error("the publisher closed the connection");
        }
        now = now_ns();
        if (counted_since == 0 && now >= begin) {
            counted_since = now;
            out.count = 0;
        }
    }
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
        if (!read_exactly(socket, message.data(), message.size()))
            throw std::runtime_error("the publisher closed the connection");
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
