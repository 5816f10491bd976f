#pragma once
#include <ise/core/result.hpp>
#include <ise/wire/frame.hpp>

#include <map>
#include <optional>

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
/// all unfinished messages together stay below a limit.
class reassembly {
public:
    explicit reassembly(std::uint64_t max_message_bytes) : max_message_bytes_(max_message_bytes) {}

    /// Takes a piece frame; gives the message when it was the last. A failure ends the connection.
    result<std::optional<assembled>> take(const frame& piece);

    std::size_t unfinished() const noexcept { return messages_.size(); }
    std::uint64_t bytes_held() const noexcept { return held_; }

private:
    struct message {
        piece_head head;
        buffer body;
    };
    std::map<std::uint64_t, message> messages_; // by id of the pieces
    std::uint64_t held_ = 0;
    std::uint64_t max_message_bytes_;
};

} // namespace ise::wire
