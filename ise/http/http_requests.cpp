#include <ise/http/http_requests.hpp>

#include <asio/buffer.hpp>

#include <utility>

namespace ise {

void http_requests::refuse(int status, std::string why) {
    auto& made = refused_.emplace();
    made.status = status;
    made.why = std::move(why);
}

task<std::optional<http_message>> http_requests::next() {
    std::optional<http_message> request;
    bool timed = !rest_.empty();
    line_.until(saturating_add(loop_.now(), timed ? times_.request : times_.idle));
    while (!reader_.complete()) {
        if (rest_.empty()) {
            auto got = co_await line_.read_some(asio::buffer(buffer_));
            rest_ = bytes_view(buffer_).first(got.bytes);
            if (got.problem && rest_.empty()) {
                if (line_.late() && reader_.begun()) refuse(408, "the request did not come to its end in time");
                co_return request; // closed, or nothing came
            }
        }
        auto used = reader_.feed(rest_);
        if (!used) {
            refuse(reader_.refusal(), used.error().message());
            co_return request;
        }
        rest_ = rest_.subspan(*used);
        // Of the whole request, not of each byte.
        if (!timed) line_.until(saturating_add(loop_.now(), times_.request));
        timed = true;
        if (reader_.wants_continue()) {
            auto unsent = co_await line_.write_all("HTTP/1.1 100 Continue\r\n\r\n");
            if (unsent) co_return request;
        }
    }
    request.emplace(reader_.take());
    co_return request;
}

task<bytes_view> http_requests::read_raw() {
    auto got = std::exchange(rest_, {});
    if (got.empty()) {
        auto read = co_await line_.read_some(asio::buffer(buffer_));
        got = bytes_view(buffer_).first(read.bytes);
    }
    co_return got;
}

} // namespace ise
