#pragma once
#include <ise/core/bytes.hpp>
#include <ise/packet/buffer.hpp>

#include <cstdint>

namespace ise {

/// The published packets that a subscriber has not taken yet, encoded, one behind the other in one buffer: what is
/// dropped was never decoded, and a burst costs a copy a packet and no allocation. Each knows how many packets were
/// lost before it.
class packet_queue {
public:
    bool empty() const noexcept { return count_ == 0; }
    std::size_t size() const noexcept { return count_; }

    void push(bytes_view packet, std::uint64_t lost_before) {
        const std::size_t size = head_bytes + packet.size();
        if (content_.capacity() - content_.size() < size) [[unlikely]] make_room(size);
        std::byte* at = content_.grow(size);
        detail::store_little(at, lost_before);
        detail::store_little(at + 8, static_cast<std::uint64_t>(packet.size()));
        if (!packet.empty()) std::memcpy(at + head_bytes, packet.data(), packet.size());
        ++count_;
    }

    /// The oldest; only where there is one. Valid until the next push or pop.
    bytes_view front() const noexcept { return {content_.data() + begin_ + head_bytes, front_size()}; }
    std::uint64_t lost_before_front() const noexcept { return detail::load_little<std::uint64_t>(content_.data() + begin_); }

    void pop() noexcept {
        begin_ += head_bytes + front_size();
        if (--count_ == 0) drained();
    }

private:
    static constexpr std::size_t head_bytes = 16;
    std::size_t front_size() const noexcept { return detail::load_little<std::uint64_t>(content_.data() + begin_ + 8); }
    void make_room(std::size_t more);
    void drained() noexcept;

    buffer content_;
    std::size_t begin_ = 0;
    std::size_t count_ = 0;
};

} // namespace ise
