// Bare Asio coroutines: what a layer over them can reach at best.
#include "floors.hpp"

#include <asio/awaitable.hpp>
#include <asio/buffer.hpp>
#include <asio/co_spawn.hpp>
#include <asio/detached.hpp>
#include <asio/io_context.hpp>
#include <asio/ip/tcp.hpp>
#include <asio/local/stream_protocol.hpp>
#include <asio/post.hpp>
#include <asio/read.hpp>
#include <asio/use_awaitable.hpp>
#include <asio/write.hpp>

#include <exception>
#include <string>
#include <unistd.h>
#include <vector>

namespace bench {
namespace {

using tcp = asio::ip::tcp;
using local = asio::local::stream_protocol;

void prepare(tcp::socket& socket) { socket.set_option(tcp::no_delay(true)); }
void prepare(local::socket&) {}

template <class Socket>
asio::awaitable<void> echo(Socket socket, std::size_t size_bytes) {
    prepare(socket);
    std::vector<char> message(size_bytes);
    try {
        for (;;) {
            co_await asio::async_read(socket, asio::buffer(message), asio::use_awaitable);
            co_await asio::async_write(socket, asio::buffer(message), asio::use_awaitable);
        }
    } catch (const std::system_error&) {
        // the measuring side is done
    }
}

template <class Protocol>
asio::awaitable<void> accept_all(typename Protocol::acceptor acceptor, std::size_t size_bytes) {
    for (;;) {
        auto socket = co_await acceptor.async_accept(asio::use_awaitable);
        asio::co_spawn(acceptor.get_executor(), echo(std::move(socket), size_bytes), asio::detached);
    }
}

template <class Socket>
asio::awaitable<void> measure(Socket socket, const options& asked, outcome& out) {
    prepare(socket);
    std::vector<char> message(asked.size_bytes);
    const auto begin = now_ns() + static_cast<std::int64_t>(asked.warmup_seconds * 1e9);
    const auto end = begin + static_cast<std::int64_t>(asked.seconds * 1e9);
    for (auto before = now_ns(); before < end;) {
        co_await asio::async_write(socket, asio::buffer(message), asio::use_awaitable);
        co_await asio::async_read(socket, asio::buffer(message), asio::use_awaitable);
        const auto after = now_ns();
        if (before >= begin) {
            out.latency.add(after - before);
            out.seconds += static_cast<double>(after - before) * 1e-9;
        }
        before = after;
    }
    out.count = out.latency.samples();
}

asio::awaitable<void> post_and_resume(const options& asked, outcome& out) {
    auto executor = co_await asio::this_coro::executor;
    const auto begin = now_ns() + static_cast<std::int64_t>(asked.warmup_seconds * 1e9);
    const auto end = begin + static_cast<std::int64_t>(asked.seconds * 1e9);
    for (auto before = now_ns(); before < end;) {
        co_await asio::post(executor, asio::use_awaitable);
        const auto after = now_ns();
        if (before >= begin) {
            out.latency.add(after - before);
            out.seconds += static_cast<double>(after - before) * 1e-9;
        }
        before = after;
    }
    out.count = out.latency.samples();
}

void run(asio::io_context& io, asio::awaitable<void> work) {
    std::exception_ptr failed;
    asio::co_spawn(io, std::move(work), [&](std::exception_ptr why) {
        failed = why;
        io.stop();
    });
    io.run();
    if (failed) std::rethrow_exception(failed);
}

local::endpoint abstract(const std::string& name) { return local::endpoint(std::string(1, '\0') + name); }

} // namespace

void serve_asio_call(const options& asked) {
    asio::io_context io(1);
    if (asked.transport == "local") {
        const auto name = "ise-bench-" + std::to_string(::getpid());
        local::acceptor acceptor(io, abstract(name));
        announce(name);
        run(io, accept_all<local>(std::move(acceptor), asked.size_bytes));
    } else {
        tcp::acceptor acceptor(io, tcp::endpoint(asio::ip::address_v4::loopback(), 0));
        announce(std::to_string(acceptor.local_endpoint().port()));
        run(io, accept_all<tcp>(std::move(acceptor), asked.size_bytes));
    }
}

outcome asio_call(const options& asked) {
    asio::io_context io(1);
    outcome out;
    if (asked.transport == "local") {
        local::socket socket(io);
        socket.connect(abstract(asked.connect));
        run(io, measure(std::move(socket), asked, out));
    } else {
        tcp::socket socket(io);
        socket.connect(tcp::endpoint(asio::ip::address_v4::loopback(),
                                     static_cast<asio::ip::port_type>(std::stoul(asked.connect))));
        run(io, measure(std::move(socket), asked, out));
    }
    return out;
}

outcome asio_post(const options& asked) {
    asio::io_context io(1);
    outcome out;
    run(io, post_and_resume(asked, out));
    return out;
}

} // namespace bench
