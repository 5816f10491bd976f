#pragma once
#include <ise/http/http_reader.hpp>
#include <ise/http/line_with_deadline.hpp>

#include <array>
#include <optional>
#include <string>

namespace ise {

struct http_times {
    duration request = std::chrono::seconds(15); ///< for a whole request, from its first byte to its last
    duration idle = std::chrono::seconds(30);    ///< before the first byte
};

struct http_refusal {
    int status = 0; ///< to answer with; 408 comes too late for an answer, see `line_with_deadline::on_late`
    std::string why;
};

/// The requests that a server reads from one connection, one after the other. Used on one loop, by one coroutine.
class http_requests {
public:
    http_requests(loop& on, std::unique_ptr<stream> line, http_reader_limits limits, http_times times)
        : loop_(on), times_(times), line_(on, std::move(line)), reader_(http_reader::reads::requests, limits) {}

    /// The next whole request; none once the connection is over: closed, too slow, or refused (see `refused`).
    /// Cancellation: terminal.
    task<std::optional<http_message>> next();

    /// Why the last request was no request, or none in time.
    const std::optional<http_refusal>& refused() const noexcept { return refused_; }

    /// A request has begun and has not come to its end.
    bool under_way() const noexcept { return reader_.begun(); }

    /// After a request that changes the protocol: bytes as they come, valid until the next call; none once the
    /// connection is over. One reader at a time. Cancellation: terminal.
    task<bytes_view> read_raw();

    /// To answer over; it has the deadline of the request until another one is set.
    line_with_deadline& line() noexcept { return line_; }

private:
    void refuse(int status, std::string why);

    loop& loop_;
    http_times times_;
    line_with_deadline line_;
    http_reader reader_;
    std::array<std::byte, 4096> buffer_;
    bytes_view rest_;
    std::optional<http_refusal> refused_;
};

} // namespace ise
