#pragma once
#include <ise/core/result.hpp>
#include <ise/wire/frame.hpp>

#include <optional>
#include <span>

namespace ise::wire {

/// Cuts a stream of bytes into frames, without I/O. Its buffer grows with what comes and shrinks again when little
/// does. Bytes are read straight into it:
/// `prepare()`, read, `commit(n)`, then `next()` until it has nothing more. Bytes may come in pieces of any size.
class parser {
public:
    explicit parser(std::uint32_t max_frame_bytes) : max_frame_bytes_(max_frame_bytes) {}

    /// Room for the next read: as much as a started frame still needs, or a read of ordinary size.
    std::span<std::byte> prepare();
    void commit(std::size_t count) noexcept {
        end_ += count;
        filled_ = end_ == storage_.size();
    }

    /// The next whole frame, or nothing. Its body stays valid until the next `prepare()`.
    /// errc::protocol_error or errc::too_large end the stream: nothing after it can be trusted.
    result<std::optional<frame>> next() {
        if (end_ - begin_ < frame_header::size) return std::optional<frame>{};
        frame found;
        found.header = read_header(storage_.data() + begin_);
        // Types up to this are known or negotiated; what is above, or 0, cannot be a frame of ISE.
        constexpr unsigned last_type = 127;
        bool sound = found.header.length <= max_frame_bytes_ && found.header.reserved == 0 &&
                     static_cast<unsigned>(found.header.type) - 1 < last_type;
        if (!sound) [[unlikely]] return refuse(found.header);
        std::size_t whole = frame_header::size + found.header.length;
        if (end_ - begin_ < whole) return std::optional<frame>{};
        found.body = bytes_view(storage_).subspan(begin_ + frame_header::size, found.header.length);
        begin_ += whole;
        return std::optional<frame>{found};
    }

    /// Bytes received that make no whole frame yet.
    std::size_t pending() const noexcept { return end_ - begin_; }
    std::size_t capacity() const noexcept { return storage_.size(); }
    /// Gives its buffer back, unless something is pending.
    void release() noexcept {
        if (pending() > 0) return;
        storage_ = std::vector<std::byte>();
        begin_ = end_ = 0;
        filled_ = false;
    }
    void set_max_frame_bytes(std::uint32_t bytes) noexcept { max_frame_bytes_ = bytes; }

private:
    failure refuse(const frame_header& header) const;

    std::vector<std::byte> storage_;
    std::size_t begin_ = 0;
    std::size_t end_ = 0;
    bool filled_ = false; // the last read filled its room: the next one gets more
    unsigned small_reads_ = 0; // in a row
    std::uint32_t max_frame_bytes_;
};

} // namespace ise::wire
