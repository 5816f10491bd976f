#pragma once
#include <components/xbee/frame.hpp>

#include <optional>

namespace atirma::xbee {

/// Frames out of a byte stream that arrives in pieces of any size and may hold garbage. After a refusal it looks for
/// the next delimiter *inside* what it took for a frame, so a false 7E costs no true frame. Holds at most one frame's
/// bytes beyond what was pushed and not yet taken.
class frame_decoder {
public:
    explicit frame_decoder(api_mode mode) : mode_(mode) {}

    void push(ise::bytes_view piece);

    /// The next frame or refusal; nothing while more bytes are wanted. Call it until it gives nothing.
    std::optional<parsed_frame> next();

    /// The line has been silent in the middle of a frame: that frame is refused as truncated and whatever true frames
    /// it swallowed come out of `next()`. Does nothing between frames.
    void give_up();

    /// A frame has begun and is not complete. Only after `next()` gave nothing.
    bool in_frame() const noexcept { return begin_ < buffer_.size(); }

    /// Bytes that stood between frames, so far (refused frames are counted by whoever takes the refusals).
    std::uint64_t skipped_bytes() const noexcept { return skipped_; }

    api_mode mode() const noexcept { return mode_; }
    /// Drops what is buffered.
    void reset(api_mode mode);

private:
    void drop(std::size_t count);

    ise::bytes buffer_;
    std::size_t begin_ = 0;
    std::uint64_t skipped_ = 0;
    bool giving_up_ = false;
    api_mode mode_;
};

} // namespace atirma::xbee
