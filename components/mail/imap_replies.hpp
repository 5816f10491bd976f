#pragma once
#include <ise/core/bytes.hpp>
#include <ise/core/result.hpp>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace atirma {

/// One reply of an IMAP server (RFC 3501), whole: a line, and what its literals brought.
struct imap_reply {
    enum class kind : std::uint8_t { untagged, continuation, tagged };
    kind what = kind::untagged;
    std::string tag;                   ///< of a tagged one
    std::string text;                  ///< the rest of the line; where a literal stood, its `{size}` still stands
    std::vector<std::string> literals; ///< in that order
};

struct imap_limits {
    std::size_t max_line_bytes = 1 << 20;    ///< a line without its literals: 150,000 numbers of mails
    std::size_t max_literal_bytes = 8 << 20; ///< all literals of one reply together
};

/// Replies out of a byte stream that comes in pieces of any size. Holds at most one reply beyond what was pushed.
class imap_replies {
public:
    explicit imap_replies(imap_limits limits = imap_limits()) : limits_(limits) {}

    void push(ise::bytes_view piece);

    /// The next reply; nothing while more bytes are wanted. Call it until it gives nothing. After an error (malformed,
    /// too_large) the stream is of no use any more, and it is given again.
    ise::result<std::optional<imap_reply>> next();

private:
    ise::failure fail(ise::errc code, std::string what);

    imap_limits limits_;
    std::string buffer_;
    std::size_t begin_ = 0;  // of what is not taken
    std::size_t looked_ = 0; // no line end before this
    std::size_t wanted_ = 0; // bytes of the literal that is under way
    std::size_t held_ = 0;   // bytes of the literals of this reply
    bool in_literal_ = false;
    std::string line_; // so far, with the literals' sizes
    std::vector<std::string> literals_;
    std::optional<ise::failure> broken_;
};

} // namespace atirma
