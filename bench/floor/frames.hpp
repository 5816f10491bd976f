#pragma once
#include <cstdint>
#include <cstring>
#include <stdexcept>
#include <vector>

namespace bench {

/// Messages that begin with their length, assembled one by one: the least that any protocol does for a message.
inline void append_message(std::vector<char>& out, const std::vector<char>& payload) {
    const auto at = out.size();
    const auto length = static_cast<std::uint32_t>(payload.size());
    out.insert(out.end(), payload.begin(), payload.end());
    std::memcpy(out.data() + at, &length, sizeof length);
}

/// Takes bytes in pieces of any size and hands on whole messages.
class message_reader {
public:
    /// Where the next piece goes, and how much fits.
    char* space() noexcept { return buffer_.data() + end_; }
    std::size_t space_bytes() const noexcept { return buffer_.size() - end_; }

    explicit message_reader(std::size_t max_bytes) : buffer_(256 * 1024 + max_bytes) {}

    /// Calls `each(data, size)` for every message that is whole once `got` more bytes have come.
    template <class Each>
    std::size_t take(std::size_t got, Each&& each) {
        end_ += got;
        std::size_t at = 0, count = 0;
        while (end_ - at >= sizeof(std::uint32_t)) {
            std::uint32_t length = 0;
            std::memcpy(&length, buffer_.data() + at, sizeof length);
            if (length < sizeof length || length > buffer_.size()) throw std::runtime_error("a length that cannot be");
            if (end_ - at < length) break;
            each(buffer_.data() + at, std::size_t{length});
            at += length;
            ++count;
        }
        std::memmove(buffer_.data(), buffer_.data() + at, end_ - at);
        end_ -= at;
        return count;
    }

private:
    std::vector<char> buffer_;
    std::size_t end_ = 0;
};

} // namespace bench
