// What a coroutine costs to compile with Asio alone: the floor of compile_user.cpp.
#include <asio/awaitable.hpp>
#include <asio/co_spawn.hpp>
#include <asio/detached.hpp>
#include <asio/io_context.hpp>

asio::awaitable<void> run() { co_return; }

int main() {
    asio::io_context io;
    asio::co_spawn(io, run(), asio::detached);
    io.run();
}
