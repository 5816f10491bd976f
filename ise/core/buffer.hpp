#pragma once
#include <ise/core/bytes.hpp>
#include <ise/core/little_endian.hpp>

#include <cstdint>
#include <cstring>
#include <span>
#include <type_traits>
#include <utility>

namespace ise {

/// Where a buffer takes large memory from, in place of the heap. Used on one loop; lives as long as a buffer with it.
class large_memory_source {
public:
    /// Smaller memory comes from the heap.
    static constexpr std::size_t min_bytes = 16 * 1024;
    /// At least so many bytes. Empty: none is left, and the buffer uses the heap.
    virtual std::span<std::byte> take(std::size_t least) = 0;
    /// Returns memory. False: it is not from this source.
    virtual bool give_back(const std::byte* at) noexcept = 0;
    virtual void add_buffer() noexcept = 0;
    virtual void remove_buffer() noexcept = 0; ///< may be its end

protected:
    ~large_memory_source() = default;
};

/// Growing output bytes. New room is not zeroed (that costs more than the copy that follows), and `clear()` keeps
/// the capacity, so that one buffer serves any number of packets without allocating.
/// Views of it (`view()`, `data()`) end with the next append.
class buffer {
public:
    buffer() = default;
    /// `large`: the source of its large memory; null: the heap.
    explicit buffer(std::size_t capacity, large_memory_source* large = nullptr) : buffer() {
        if (large) large->add_buffer();
        large_ = large;
        reserve(capacity);
    }
    buffer(buffer&& other) noexcept
        : data_(std::exchange(other.data_, nullptr)), size_(std::exchange(other.size_, 0)),
          capacity_(std::exchange(other.capacity_, 0)), large_(std::exchange(other.large_, nullptr)) {}
    buffer& operator=(buffer&& other) noexcept {
        std::swap(data_, other.data_);
        std::swap(size_, other.size_);
        std::swap(capacity_, other.capacity_);
        std::swap(large_, other.large_);
        return *this;
    }
    ~buffer() {
        if (data_) free();
        if (large_) large_->remove_buffer();
    }

    const std::byte* data() const noexcept { return data_; }
    std::byte* data() noexcept { return data_; }
    std::size_t size() const noexcept { return size_; }
    std::size_t capacity() const noexcept { return capacity_; }
    bool empty() const noexcept { return size_ == 0; }
    large_memory_source* large_memory() const noexcept { return large_; }
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
    large_memory_source* large_ = nullptr;
};

} // namespace ise
