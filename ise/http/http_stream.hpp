#pragma once
#include <ise/http/http_requests.hpp>

#include <ise/core/loop.hpp>
#include <ise/core/task.hpp>

#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <system_error>

namespace ise {

struct http_stream_times {
    duration write = std::chrono::seconds(90);  ///< for the client to take one piece
    duration silent = std::chrono::seconds(60); ///< without a piece; then the connection is closed
};

/// The body of a response that is sent while it is made, piece by piece; the connection ends with it. Used on one loop;
/// one write at a time.
class http_stream {
public:
    /// `head` is sent with the first piece.
    http_stream(loop& on, std::shared_ptr<http_requests> over, std::string head, bool chunked, http_stream_times times);

    /// Sends a piece, which stays valid as long; completes when the system has taken it. Errors: those of the
    /// connection, timed_out, not_connected after `close`. Cancellation: terminal, part of it may have gone.
    task<std::error_code> write(std::string_view piece);
    /// Ends the body. Cancellation: terminal.
    task<> finish();
    /// Closes the connection; between pieces the body is complete, within one it is cut off. Idempotent.
    void close() noexcept;
    /// Called once, when either side closes the connection.
    void on_closed(std::function<void()> result) { on_closed_ = std::move(result); }

    /// Reads, and keeps nothing, so that `self` is closed as soon as the client leaves. Cancellation: terminal.
    static task<> watch(std::shared_ptr<http_stream> self);

private:
    loop& loop_;
    std::shared_ptr<http_requests> over_;
    std::string head_;
    bool chunked_;
    http_stream_times times_;
    std::function<void()> on_closed_;
    bool busy_ = false, closed_ = false, ended_ = false;
};

} // namespace ise
