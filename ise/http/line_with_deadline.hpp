#pragma once
#include <ise/core/loop.hpp>
#include <ise/core/stream.hpp>

#include <asio/buffer.hpp>

#include <cstddef>
#include <functional>
#include <memory>
#include <string_view>
#include <vector>

namespace ise {

/// A stream that gives up at a time: then what waits and what follows fails with `asio::error::timed_out`, and the
/// stream is closed. Used on one loop; one operation at a time.
class line_with_deadline {
public:
    line_with_deadline(loop& on, std::unique_ptr<stream> line);

    /// From now on, until it is set anew; time_point::max() is never.
    void until(time_point deadline);

    /// As stream. Cancellation: terminal.
    task<transfer> read_some(asio::mutable_buffer into);
    /// Writes all of it; `content` stays valid as long. Errors: those of the stream, timed_out. Cancellation: terminal,
    /// part of it may have gone.
    task<std::error_code> write_all(std::string_view content);
    /// The same of several pieces, one after the other; errors and cancellation as above.
    task<std::error_code> write_all(std::vector<std::string_view> pieces);

    /// Reads until the other side closes, the deadline, or `most` bytes, and keeps nothing: whoever closes on bytes
    /// that were not read may take back what it has written. Cancellation: terminal.
    task<> drop_rest(std::size_t most);

    /// Called at the deadline, before the stream is closed: what is written then without waiting still goes out.
    void on_late(std::function<void()> last_words) { last_words_ = std::move(last_words); }

    bool late() const noexcept { return late_; }
    stream& line() noexcept { return *line_; }

private:
    std::unique_ptr<stream> line_;
    std::function<void()> last_words_;
    bool late_ = false;
    timer alarm_;
};

} // namespace ise
