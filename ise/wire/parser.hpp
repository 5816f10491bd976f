#pragma once
#include <ise/core/buffer.hpp>
#include <ise/core/result.hpp>
#include <ise/wire/frame.hpp>

#include <optional>
#include <span>

namespace ise::wire {

/// Cuts a stream of bytes into frames, without I/O. Its buffer grows with what comes and shrinks again when little
/// does. Bytes are read straight into it (`prepare()`, read, `commit(n)`), or come as a whole buffer (`add`); then
/// `next()` until it has nothing more. Bytes may come in pieces of any size.
class parser {
public:
    /// `limit`: the name of that limit, a literal, for the error beyond it.
    explicit parser(std::uint32_t max_frame_bytes, const char* limit = "max_frame_bytes")
        : limit_(limit), max_frame_bytes_(max_frame_bytes) {}

    /// Room for the next read: as much as a started frame still needs, or a read of ordinary size.
    std::span<std::byte> prepare();
    void commit(std::size_t count) { storage_.grow(count); }
    /// Takes over a buffer of bytes, and leaves an empty one in its place.
    void add(buffer& content);
    /// Bytes that were read elsewhere, behind those that are here.
    void add(bytes_view content);

    /// The next whole frame, or nothing. Its body stays valid until the next `prepare()` or `add`.
    /// errc::protocol_error or errc::too_large end the stream: nothing after it can be trusted.
    result<std::optional<frame>> next() {
        frame found;
        if (take(found)) return std::optional<frame>{found};
        if (sound()) return std::optional<frame>{};
        return refusal();
    }

    /// The next frame where it is whole and sound; where not, `sound()` says whether more bytes make it one. For many
    /// in a row.
    bool take(frame& found) noexcept {
        if (pending() < frame_header::size) return false;
        const std::byte* at = storage_.data() + begin_;
        found.header = read_header(at);
        const std::size_t whole = frame_header::size + found.header.length;
        if (!sound(found.header) || pending() < whole) [[unlikely]]
            return false;
        found.body = {at + frame_header::size, found.header.length};
        begin_ += whole;
        return true;
    }

    /// `first` was taken: takes the whole frames behind it with the same type, flags and id, too. Returns all of them
    /// with `first`, and counts the others. Valid as long as its body.
    bytes_view take_alike(const frame& first, std::uint64_t& others) noexcept;

    /// The frame that has begun, with what has come of its body; only where it is sound, and `take` found none whole.
    std::optional<frame> begun() const noexcept {
        if (pending() < frame_header::size) return std::nullopt;
        const auto left = storage_.view().subspan(begin_);
        return frame{read_header(left.data()), left.subspan(frame_header::size)};
    }
    /// It was taken: whoever did reads the rest of it.
    void give_begun() noexcept { begin_ = storage_.size(); }

    /// Whether what is left can become a frame.
    bool sound() const noexcept {
        return pending() < frame_header::size || sound(read_header(storage_.data() + begin_));
    }
    /// Why not. Only where it cannot.
    failure refusal() const { return refuse(read_header(storage_.data() + begin_)); }

    /// Bytes received that make no whole frame yet.
    std::size_t pending() const noexcept { return storage_.size() - begin_; }
    std::size_t capacity() const noexcept { return storage_.capacity(); }
    /// Gives its buffer back, unless something is pending.
    void release() noexcept {
        if (pending() > 0) return;
        storage_ = buffer();
        begin_ = room_ = 0;
    }
    void set_max_frame_bytes(std::uint32_t bytes) noexcept {
        limit_ = "max_frame_bytes";
        max_frame_bytes_ = bytes;
    }

private:
    bool sound(const frame_header& header) const noexcept {
        // Types up to this are known or negotiated; what is above, or 0, cannot be a frame of ISE.
        constexpr unsigned last_type = 127;
        return header.length <= max_frame_bytes_ && header.reserved == 0 &&
               static_cast<unsigned>(header.type) - 1 < last_type;
    }
    failure refuse(const frame_header& header) const;
    void drop_taken() noexcept;

    buffer storage_;
    std::size_t begin_ = 0;    // what lies before was taken
    std::size_t room_ = 0;     // of the buffer, for reads
    unsigned small_reads_ = 0; // in a row
    const char* limit_;
    std::uint32_t max_frame_bytes_;
};

} // namespace ise::wire
