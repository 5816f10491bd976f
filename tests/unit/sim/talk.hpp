// What the tests of the virtual world share: small coroutines over streams and timers.
#pragma once
#include <ise/asio.hpp>
#include <ise/core/waiter.hpp>
#include <ise/sim/world.hpp>

#include <asio/buffer.hpp>
#include <asio/detached.hpp>
#include <asio/post.hpp>

#include <array>
#include <string>

namespace talk {

using namespace std::chrono_literals;
using ise::task;

inline void spawn(ise::loop& on, task<> what) { ise::async_run(on.get_executor(), std::move(what), asio::detached); }

inline ise::endpoint at(const std::string& text) { return ise::endpoint::parse(text).value(); }

// Waits on the loop's clock.
inline task<> sleep(ise::loop& on, ise::duration time) {
    ise::waiter<> over(on);
    ise::timer wake(on, [&over] { over.resume(); });
    wake.arm(on.now() + time);
    co_await over.wait();
}

inline task<std::error_code> write_all(ise::stream& to, std::string text) {
    std::string_view left = text;
    while (!left.empty()) {
        std::array pieces{asio::const_buffer(left.data(), left.size())};
        auto moved = to.try_write(pieces);
        left.remove_prefix(moved.bytes);
        if (moved.problem == asio::error::would_block) {
            auto problem = co_await to.wait_writable();
            if (problem) co_return problem;
        } else if (moved.problem) {
            co_return moved.problem;
        }
    }
    co_return std::error_code{};
}

// Everything until the end or an error.
inline task<std::error_code> read_all(ise::stream& from, std::string& into) {
    std::array<char, 4096> room;
    for (;;) {
        auto got = co_await from.read_some(asio::buffer(room));
        if (got.problem) co_return got.problem;
        into.append(room.data(), got.bytes);
    }
}

// Sends back what it gets, on every connection, one after the other.
inline task<> echo_server(ise::environment& env, ise::loop& on, ise::endpoint where) {
    auto channel = env.listen(on, where);
    if (!channel) co_return;
    for (;;) {
        auto [problem, client] = co_await (*channel)->accept();
        if (problem) co_return;
        std::array<char, 4096> room;
        for (;;) {
            auto got = co_await client->read_some(asio::buffer(room));
            if (got.problem) break;
            auto failed = co_await write_all(*client, std::string(room.data(), got.bytes));
            if (failed) break;
        }
    }
}

} // namespace talk
