#pragma once
#include <ise/core/bytes.hpp>
#include <ise/core/result.hpp>

#include <optional>
#include <string>
#include <string_view>

// What SMTP (RFC 5321) needs to hand a mail over. Pure.
namespace atirma {

/// A server's reply: "250 2.0.0 taken"; of several lines the last one's code and all texts.
struct smtp_reply {
    int code = 0;     ///< 200 … 599
    std::string text; ///< "250 2.0.0 taken", lines joined by blanks

    bool is_good() const noexcept { return code >= 200 && code < 400; }
    bool is_final() const noexcept { return code >= 500; } ///< asking again does not help
};

/// Replies out of a byte stream that comes in pieces of any size, each at most `max_bytes`.
class smtp_replies {
public:
    explicit smtp_replies(std::size_t max_bytes = 16 * 1024) : max_(max_bytes) {}

    void push(ise::bytes_view piece) { buffer_.append(ise::as_text(piece)); }
    /// The next reply; nothing while more bytes are wanted. Errors: malformed, too_large: the stream is of no use any
    /// more.
    ise::result<std::optional<smtp_reply>> next();

private:
    std::size_t max_;
    std::string buffer_;
    std::string text_; // of the lines so far
};

/// A mail as it goes over the wire after DATA, without the final dot: every line ends in CR LF, and one that begins
/// with a dot gets another in front.
std::string smtp_content(std::string_view mail);

} // namespace atirma
