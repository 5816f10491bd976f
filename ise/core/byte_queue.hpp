#pragma once
#include <ise/core/bytes.hpp>

#include <algorithm>
#include <cstddef>
#include <cstring>

namespace ise {

/// A bounded queue of bytes: a ring that grows up to its limit, and gives back what a burst took once it is empty.
class byte_queue {
public:
    explicit byte_queue(std::size_t limit_bytes) : limit_(limit_bytes) {}

    std::size_t size() const noexcept { return size_; }
    bool empty() const noexcept { return size_ == 0; }
    std::size_t room() const noexcept { return limit_ - size_; }
    std::size_t limit() const noexcept { return limit_; }
    /// For how many bytes it holds memory.
    std::size_t capacity() const noexcept { return ring_.size(); }

    /// Appends as much as there is room for; says how much.
    std::size_t push(bytes_view from) {
        const auto count = std::min(from.size(), room());
        reserve(size_ + count);
        const auto tail = ring_.empty() ? 0 : (head_ + size_) % ring_.size();
        const auto first = std::min(count, ring_.size() - tail);
        copy(ring_.data() + tail, from.data(), first);
        copy(ring_.data(), from.data() + first, count - first);
        size_ += count;
        return count;
    }

    /// Takes as much as fits into `into`; says how much.
    std::size_t pop(std::span<std::byte> into) noexcept {
        const auto count = std::min(into.size(), size_);
        const auto first = std::min(count, ring_.size() - head_);
        copy(into.data(), ring_.data() + head_, first);
        copy(into.data() + first, ring_.data(), count - first);
        size_ -= count;
        if (size_ == 0) clear();
        else head_ = (head_ + count) % ring_.size();
        return count;
    }

    void clear() noexcept {
        head_ = size_ = 0;
        if (ring_.size() > kept_empty) bytes().swap(ring_);
    }

private:
    static constexpr std::size_t kept_empty = 4096; // bytes; the memory of larger rings is for bursts

    static void copy(std::byte* to, const std::byte* from, std::size_t count) noexcept {
        if (count > 0) std::memcpy(to, from, count);
    }

    void reserve(std::size_t wanted) {
        if (wanted <= ring_.size()) return;
        auto capacity = std::max<std::size_t>(ring_.size() * 2, 1024);
        while (capacity < wanted) capacity *= 2;
        bytes grown(std::min(capacity, limit_));
        const auto count = size_;
        pop({grown.data(), count});
        ring_ = std::move(grown);
        head_ = 0;
        size_ = count;
    }

    bytes ring_;
    std::size_t limit_;
    std::size_t head_ = 0;
    std::size_t size_ = 0;
};

} // namespace ise
