#include "tapped_stream.hpp"

#include <asio/buffer.hpp>

#include <algorithm>

namespace atirma::stress {
namespace {

class far_end final : public ise::stream {
public:
    far_end(std::unique_ptr<ise::stream> line, std::unique_ptr<tap> by) : line_(std::move(line)), tap_(std::move(by)) {}

    ise::task<ise::transfer> read_some(asio::mutable_buffer into) override {
        auto got = co_await line_->read_some(into);
        if (got.bytes > 0) tap_->wrote(ise::bytes_view(static_cast<const std::byte*>(into.data()), got.bytes));
        co_return got;
    }
    ise::transfer try_write(std::span<const asio::const_buffer> from) override {
        auto done = line_->try_write(from);
        auto left = done.bytes;
        for (const auto& piece : from) {
            auto part = std::min(left, piece.size());
            if (part > 0) tap_->read(ise::bytes_view(static_cast<const std::byte*>(piece.data()), part));
            left -= part;
        }
        return done;
    }
    ise::task<std::error_code> wait_writable() override { return line_->wait_writable(); }
    void limit_unsent(std::size_t most) override { line_->limit_unsent(most); }
    void shutdown_write() override { line_->shutdown_write(); }
    void close() override { line_->close(); }
    std::string peer() const override { return line_->peer(); }

private:
    std::unique_ptr<ise::stream> line_;
    std::unique_ptr<tap> tap_;
};

} // namespace

std::unique_ptr<ise::stream> tapped_far_end(std::unique_ptr<ise::stream> line, std::unique_ptr<tap> by) {
    return std::make_unique<far_end>(std::move(line), std::move(by));
}

} // namespace atirma::stress
