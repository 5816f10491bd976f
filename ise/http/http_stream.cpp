#include <ise/http/http_stream.hpp>

#include <asio/buffer.hpp>
#include <asio/error.hpp>
#include <fmt/format.h>

#include <utility>
#include <vector>

namespace ise {
namespace {

constexpr std::size_t max_unasked = 64 * 1024; // bytes that a client sends although nobody reads them
constexpr std::string_view last_chunk = "0\r\n\r\n";

} // namespace

http_stream::http_stream(loop& on, std::shared_ptr<http_requests> over, std::string head, bool chunked,
                         http_stream_times times)
    : loop_(on), over_(std::move(over)), head_(std::move(head)), chunked_(chunked), times_(times) {
    over_->line().until(saturating_add(loop_.now(), times_.silent));
}

task<std::error_code> http_stream::write(std::string_view piece) {
    if (closed_) co_return asio::error::not_connected;
    auto start = std::exchange(head_, {});
    if (chunked_ && !piece.empty()) start += fmt::format("{:x}\r\n", piece.size());
    std::vector<std::string_view> pieces(3);
    pieces[0] = start;
    pieces[1] = piece;
    pieces[2] = chunked_ && !piece.empty() ? "\r\n" : ""; // an empty chunk would end the body
    auto& line = over_->line();
    busy_ = true;
    line.until(saturating_add(loop_.now(), times_.write));
    auto unsent = co_await line.write_all(std::move(pieces));
    line.until(saturating_add(loop_.now(), times_.silent));
    busy_ = false;
    co_return unsent;
}

task<> http_stream::finish() {
    if (closed_) co_return;
    ended_ = true;
    auto last = std::exchange(head_, {});
    if (chunked_) last += last_chunk;
    over_->line().until(saturating_add(loop_.now(), times_.write));
    co_await over_->line().write_all(last);
}

void http_stream::close() noexcept {
    if (std::exchange(closed_, true)) return;
    auto& line = over_->line().line();
    asio::const_buffer last(last_chunk.data(), last_chunk.size());
    if (chunked_ && !busy_ && !ended_ && head_.empty()) line.try_write(std::span(&last, 1)); // an end, not a failure
    line.close();
    if (auto result = std::exchange(on_closed_, nullptr)) result();
}

task<> http_stream::watch(std::shared_ptr<http_stream> self) {
    auto held = std::move(self);
    co_await held->over_->line().drop_rest(max_unasked);
    held->close();
}

} // namespace ise
