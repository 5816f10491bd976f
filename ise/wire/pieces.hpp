#pragma once
#include <ise/core/result.hpp>
#include <ise/wire/frame.hpp>

#include <map>
#include <optional>
#include <span>

namespace ise::wire {

/// A message that came in pieces, whole again.
struct assembled {
    frame_header header;
    buffer body;
};

/// The head of a message's first piece: the header of the whole, its length as 64 bits.
struct piece_head {
    frame_type type{};
    std::uint8_t flags = 0;
    std::uint64_t id = 0;
    std::uint64_t length = 0;

    static constexpr std::size_t size = 18;
    void put(buffer& out) const;
    static piece_head read(bytes_view from);
};

/// Puts messages together from their pieces. What a head claims costs nothing: memory grows with what came, and
/// all unfinished messages together stay below a limit. A piece is taken whole, or begun where only a part of it has
/// come: the rest is then read straight to its place in the message.
class reassembly {
public:
    explicit reassembly(std::uint64_t max_message_bytes) : max_message_bytes_(max_message_bytes) {}

    /// Takes a piece frame; gives the message when it was the last. A failure ends the connection.
    result<std::optional<assembled>> take(const frame& piece);

    /// Begins with a piece of which `part.body` has come, less than its header says. False: that is not enough.
    result<bool> begin(const frame& part);
    /// Bytes of the piece that was begun which have not come; while there are any, no other piece is taken.
    std::size_t missing() const noexcept { return missing_; }
    /// Where they go, with room for the header of the next frame behind them.
    std::span<std::byte> room();
    /// So many of them are there. Gives the message as `take`.
    result<std::optional<assembled>> fill(std::size_t count);

    std::size_t unfinished() const noexcept { return messages_.size(); }
    std::uint64_t bytes_held() const noexcept { return held_; }

private:
    struct message {
        piece_head head;
        buffer body;
    };
    using messages = std::map<std::uint64_t, message>;

    result<void> open(const frame_header& piece, bytes_view come);

    messages messages_;         // by id of the pieces
    messages::iterator filled_; // that of the piece that was begun
    std::size_t missing_ = 0;   // of that piece
    bool last_ = false;         // that piece
    std::uint64_t held_ = 0;
    std::uint64_t max_message_bytes_;
};

} // namespace ise::wire
