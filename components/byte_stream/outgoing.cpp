#include <components/byte_stream/outgoing.hpp>

#include <asio/buffer.hpp>
#include <asio/error.hpp>

namespace atirma {

std::error_code outgoing::write(ise::stream& to) {
    while (!bytes_.empty()) {
        asio::const_buffer rest(bytes_.data(), bytes_.size());
        auto moved = to.try_write(std::span(&rest, 1));
        bytes_.erase(0, moved.bytes);
        if (moved.problem == asio::error::would_block) return {};
        if (moved.problem) return moved.problem;
        if (moved.bytes == 0) return {};
    }
    return {};
}

} // namespace atirma
