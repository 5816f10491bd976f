#pragma once
#include <ise/core/bytes.hpp>
#include <ise/core/result.hpp>

#include <cstdint>
#include <string>
#include <string_view>

// WebSocket (RFC 6455): the handshake's texts and the frames. Pure.
namespace ise {

/// A close code of RFC 6455, section 7.4.1.
enum class web_socket_code : std::uint16_t {
    normal = 1000,
    going_away = 1001,
    protocol_error = 1002,
    unsupported = 1003,
    no_status = 1005, ///< never sent: a close frame without a code
    not_utf8 = 1007,
    policy = 1008,
    too_large = 1009,
    internal_error = 1011,
    try_again = 1013,
};

/// What a frame is.
enum class web_socket_opcode : std::uint8_t { continuation = 0, text = 1, binary = 2, close = 8, ping = 9, pong = 10 };

/// What peers can cost a reader at most.
struct web_socket_limits {
    std::size_t max_message_bytes = std::size_t{1} << 20; ///< of a message, its fragments together
    std::size_t max_fragments = 1024;                     ///< of one message
};

/// A whole message, or a control frame.
struct web_socket_message {
    web_socket_opcode kind = web_socket_opcode::text;  ///< never `continuation`
    std::string payload;                               ///< of a close: the reason; text is UTF-8
    web_socket_code code = web_socket_code::no_status; ///< of a close
};

/// Reads frames out of bytes as they come. Not thread safe.
class web_socket_reader {
public:
    /// Whose frames it reads: those of clients are masked, those of servers are not.
    enum class from { clients, servers };
    explicit web_socket_reader(from whose, web_socket_limits limits = web_socket_limits());

    /// Takes bytes until one message or control frame is whole, and returns how many. The rest belongs to the next one:
    /// `take()`, then feed it. Errors: malformed, too_large (`refusal()` is the code to close with). It is of no more
    /// use after an error.
    result<std::size_t> feed(bytes_view in);
    bool complete() const noexcept { return complete_; } ///< there is something to `take`
    web_socket_message take();                           ///< only where `complete()`
    /// The code that answers an error of `feed`.
    web_socket_code refusal() const noexcept { return refusal_; }

private:
    failure refuse(web_socket_code code, std::string why);
    result<void> begin();
    result<void> end();

    from whose_;
    web_socket_limits limits_;
    std::string head_;           // of the present frame, as far as it has come
    std::size_t head_bytes_ = 2; // that it will have
    std::uint64_t left_ = 0;     // of the payload
    std::uint8_t mask_[4] = {};  //
    std::size_t masked_ = 0;     // bytes of the payload so far
    bool in_payload_ = false, last_ = false, complete_ = false, failed_ = false;
    web_socket_opcode opcode_ = web_socket_opcode::continuation;  // of the frame
    web_socket_opcode message_ = web_socket_opcode::continuation; // of the fragmented message; continuation: none
    std::size_t fragments_ = 0;
    std::string data_, control_; // payloads
    web_socket_message made_;
    web_socket_code refusal_ = web_socket_code::protocol_error;
};

/// Appends the head of an unmasked final frame, which a payload of this size follows.
void append_frame_head(std::string& to, web_socket_opcode kind, std::uint64_t payload_bytes);
/// Appends a whole unmasked frame.
void append_frame(std::string& to, web_socket_opcode kind, std::string_view payload);
/// Appends a whole frame of a client, masked with `mask`.
void append_masked_frame(std::string& to, web_socket_opcode kind, std::string_view payload, std::uint32_t mask,
                         bool last = true);
/// Appends a close frame; the reason is cut to what a control frame holds.
void append_close(std::string& to, web_socket_code code, std::string_view reason);

/// The value of Sec-WebSocket-Accept for that of Sec-WebSocket-Key.
std::string web_socket_accept(std::string_view key);
/// Whether it is base64 of 16 bytes.
bool is_web_socket_key(std::string_view key) noexcept;
/// Whether a comma-separated header has this token, in any case.
bool lists_token(std::string_view header, std::string_view token) noexcept;

} // namespace ise
