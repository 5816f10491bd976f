#pragma once
#include <components/gprs/line.hpp>

namespace atirma::gprs {

/// Lines out of bytes that come in pieces of any size. Holds one unfinished line at most; one that is too long is told
/// once and left out up to its end. Empty lines count for nothing.
class line_reader {
public:
    /// Take what `next()` gives before more is pushed: then at most this much and a line are held.
    void push(ise::bytes_view bytes);

    /// The next line, or what is wrong with it (malformed, too_large); nothing where the rest is to come.
    std::optional<ise::result<line>> next();

    /// Bytes of what is not finished.
    std::size_t held() const noexcept { return buffer_.size() - taken_; }

private:
    std::string buffer_;
    std::size_t taken_ = 0;
    bool skipping_ = false;
};

} // namespace atirma::gprs
