// What a user's first file looks like, as far as the headers go.
#if __has_include(<ise/ise.hpp>)
#include <ise/ise.hpp>
#else
#include <ise/core/result.hpp>
#include <ise/core/task.hpp>
#endif
#include <asio/co_spawn.hpp>
#include <asio/detached.hpp>
#include <asio/io_context.hpp>

#include <cstdio>

namespace {
ise::task<> answer(ise::result<int>& out) {
    out = 42;
    co_return;
}
} // namespace

int main() {
    asio::io_context io;
    ise::result<int> out = ise::failure(ise::errc::timed_out, "the coroutine never ran");
    asio::co_spawn(io, answer(out), asio::detached);
    io.run();
    if (!out) {
        std::fprintf(stderr, "%s\n", out.error().message().c_str());
        return 1;
    }
    std::printf("installed and linked: %d\n", out.value());
    return out.value() == 42 && ise::make_error_code(ise::errc::refused).message() == "refused" ? 0 : 1;
}
