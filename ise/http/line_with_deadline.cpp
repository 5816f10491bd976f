#include <ise/http/line_with_deadline.hpp>

#include <asio/buffer.hpp>
#include <asio/error.hpp>

#include <array>

namespace ise {

line_with_deadline::line_with_deadline(loop& on, std::unique_ptr<stream> line)
    : line_(std::move(line)), alarm_(on, [this] {
          if (last_words_) last_words_();
          late_ = true;
          line_->close();
      }) {}

void line_with_deadline::until(time_point deadline) {
    if (deadline == time_point::max()) alarm_.disarm();
    else alarm_.arm(deadline);
}

task<transfer> line_with_deadline::read_some(asio::mutable_buffer into) {
    transfer got;
    if (!late_) got = co_await line_->read_some(into);
    if (late_) got.problem = asio::error::timed_out;
    co_return got;
}

task<std::error_code> line_with_deadline::write_all(std::string_view content) {
    std::vector<std::string_view> one(1, content);
    return write_all(std::move(one));
}

task<std::error_code> line_with_deadline::write_all(std::vector<std::string_view> pieces) {
    std::vector<asio::const_buffer> left;
    for (auto piece : pieces) left.emplace_back(piece.data(), piece.size());
    for (std::span<asio::const_buffer> rest = left; !rest.empty();) {
        if (late_) co_return asio::error::timed_out;
        auto moved = line_->try_write(rest);
        auto sent = moved.bytes;
        while (!rest.empty() && sent >= rest.front().size()) {
            sent -= rest.front().size();
            rest = rest.subspan(1);
        }
        if (!rest.empty()) rest.front() += sent;
        if (moved.problem == asio::error::would_block) {
            auto problem = co_await line_->wait_writable();
            if (late_) co_return asio::error::timed_out;
            if (problem) co_return problem;
        } else if (moved.problem) {
            co_return moved.problem;
        }
    }
    co_return std::error_code();
}

task<> line_with_deadline::drop_rest(std::size_t most) {
    std::array<std::byte, 4096> room;
    for (std::size_t dropped = 0; dropped < most;) {
        auto got = co_await read_some(asio::buffer(room));
        if (got.problem) break;
        dropped += got.bytes;
    }
}

} // namespace ise
