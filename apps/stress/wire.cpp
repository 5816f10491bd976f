#include "wire.hpp"

#include <asio/buffer.hpp>
#include <asio/error.hpp>

#include <array>

namespace atirma::stress {
namespace {

ise::task<> pump(std::shared_ptr<wire> what, bool outward) {
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

} // namespace

ise::task<> carry(ise::component& self, std::shared_ptr<wire> what) {
    self.spawn("inward", pump(what, false));
    auto outward = pump(what, true);
    co_await std::move(outward);
}

} // namespace atirma::stress
