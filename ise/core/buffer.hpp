#pragma once
#include <ise/core/bytes.hpp>
#include <ise/core/little_endian.hpp>

#include <cstdint>
#include <cstring>
#include <type_traits>
#include <utility>

namespace ise {

/// Growing output bytes. New room is not zeroed (that costs more than the copy that follows), and `clear()` keeps
/// the capacity, so that one buffer serves any number of packets without allocating.
/// Views of it (`view()`, `data()`) end with the next append.
class buffer {
public:
    buffer() = default;
    explicit buffer(std::size_t capacity) { reserve(capacity); }
    buffer(buffer&& other) noexcept
        : data_(std::exchange(other.data_, nullptr)), size_(std::exchange(other.size_, 0)),
          capacity_(std::exchange(other.capacity_, 0)) {}
    buffer& operator=(buffer&& other) noexcept {
        std::swap(data_, other.data_);
        std::swap(size_, other.size_);
        std::swap(capacity_, other.capacity_);
        return *this;
    }
    ~buffer() {
        if (data_) free();
    }

    const std::byte* data() const noexcept { return data_; }
    std::byte* data() noexcept { return data_; }
    std::size_t size() const noexcept { return size_; }
    std::size_t capacity() const noexcept { return capacity_; }
    bool empty() const noexcept { return size_ == 0; }
    bytes_view view() const noexcept { return {data_, size_}; }
    bytes to_bytes() const { return {data_, data_ + size_}; }

    void clear() noexcept { size_ = 0; }
    void reserve(std::size_t capacity) {
        if (capacity > capacity_) enlarge(capacity - size_);
    }
    /// Drops what lies behind `size`.
    void truncate(std::size_t size) noexcept {
        if (size < size_) size_ = size;
    }

    /// Room for `count` more bytes, uninitialised: the caller writes every one of them.
    std::byte* grow(std::size_t count) {
        if (capacity_ - size_ < count) [[unlikely]]
            enlarge(count);
        std::byte* room = data_ + size_;
        size_ += count;
        return room;
    }

    void append(bytes_view raw) {
        if (!raw.empty()) std::memcpy(grow(raw.size()), raw.data(), raw.size());
    }

    /// An integer or a float, little-endian.
    template <class T>
    requires std::is_arithmetic_v<T>
    void append(T value) { detail::store_little(grow(sizeof(T)), value); }

    /// Drops what lies before `count`; the rest moves to the front.
    void drop_front(std::size_t count) noexcept {
        size_ -= count;
        std::memmove(data_, data_ + count, size_);
    }
    /// Empties what is going to be filled again. A burst must not pin its memory; what is filled again and again keeps
    /// it, or each time would get fresh pages from the kernel.
    void recycle() noexcept {
        constexpr std::size_t kept_capacity = 256 * 1024;
        if (capacity_ > kept_capacity && size_ > 0 && size_ < capacity_ / 4) *this = buffer();
        clear();
    }

    /// Overwrites four bytes that were appended before, little-endian.
    void patch_u32(std::size_t offset, std::uint32_t value) noexcept { detail::store_little(data_ + offset, value); }

private:
    void enlarge(std::size_t more);
    void free() noexcept;

    std::byte* data_ = nullptr;
    std::size_t size_ = 0;
    std::size_t capacity_ = 0;
};

} // namespace ise
