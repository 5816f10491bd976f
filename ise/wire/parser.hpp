#pragma once
#include <ise/core/result.hpp>
#include <ise/wire/frame.hpp>

#include <optional>
#include <span>

namespace ise::wire {

/// Cuts a stream of bytes into frames, without I/O. Bytes are read straight into its buffer:
/// `prepare()`, read, `commit(n)`, then `next()` until it has nothing more. Bytes may come in pieces of any size.
class parser {
public:
    explicit parser(std::uint32_t max_frame_bytes) : max_frame_bytes_(max_frame_bytes) {}

    /// Room for the next read: as much as a started frame still needs, or a read of ordinary size.
    std::span<std::byte> prepare();
    void commit(std::size_t count) noexcept { end_ += count; }

    /// The next whole frame, or nothing. Its body stays valid until the next `prepare()`.
    /// errc::protocol_error or errc::too_large end the stream: nothing after it can be trusted.
    result<std::optional<frame>> next();

    /// Bytes received that make no whole frame yet.
    std::size_t pending() const noexcept { return end_ - begin_; }
    std::size_t capacity() const noexcept { return storage_.size(); }
    void set_max_frame_bytes(std::uint32_t bytes) noexcept { max_frame_bytes_ = bytes; }

private:
    std::vector<std::byte> storage_;
    std::size_t begin_ = 0;
    std::size_t end_ = 0;
    bool filled_ = false; // the last read filled its room: the next one gets more
    std::uint32_t max_frame_bytes_;
};

} // namespace ise::wire
