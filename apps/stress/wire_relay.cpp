#include "wire_relay.hpp"

#include <array>

namespace atirma::stress {

ise::task<> wire_relay::run() {
    auto door = env().listen(on(), ise::endpoint::parse(listen_).value());
    auto at = std::move(door.value());
    for (;;) {
        auto [problem, near] = co_await at->accept();
        if (problem) {
            co_await sleep(std::chrono::milliseconds(100));
            continue;
        }
        auto made = std::make_shared<line>();
        made->near = std::move(near);
        made->by = make_();
        spawn("line", carry(std::move(made)));
    }
}

ise::task<> wire_relay::carry(std::shared_ptr<line> what) {
    auto to = ise::endpoint::parse(onward_).value();
    auto opened = co_await env().connect(on(), to);
    if (!opened) {
        what->near->close();
        co_return;
    }
    what->far = std::move(*opened);
    spawn("inward", pump(what, false));
    auto outward = pump(what, true);
    co_await std::move(outward);
}

ise::task<> wire_relay::pump(std::shared_ptr<line> what, bool outward) {
    auto& from = outward ? *what->near : *what->far;
    auto& to = outward ? *what->far : *what->near;
    std::array<std::byte, 2048> buffer;
    for (bool good = true; good;) {
        auto got = co_await from.read_some(asio::buffer(buffer));
        ise::bytes_view left(buffer.data(), got.bytes);
        if (!left.empty() && outward) what->by->wrote(left);
        if (!left.empty() && !outward) what->by->read(left);
        while (good && !left.empty()) {
            const asio::const_buffer piece(left.data(), left.size());
            auto done = to.try_write(std::span(&piece, 1));
            left = left.subspan(done.bytes);
            if (left.empty() || !done.problem) continue;
            auto problem = done.problem;
            if (problem == asio::error::would_block) problem = co_await to.wait_writable();
            if (problem) good = false;
        }
        if (got.problem) good = false;
    }
    what->near->close();
    what->far->close();
}

} // namespace atirma::stress
