#pragma once
#include <ise/core/buffer.hpp>
#include <ise/core/bytes.hpp>
#include <ise/core/ring.hpp>

#include <cstddef>
#include <span>
#include <utility>

namespace ise {

/// Bytes that are written once and then shared by all who send them. A value; a copy costs a count. All who share them
/// are on one loop: the count is an ordinary number, as a locked one would cost more than copying a small packet.
class shared_bytes {
public:
    shared_bytes() = default;
    /// Takes over a whole buffer; throws where it cannot, and `content` stays as it is.
    explicit shared_bytes(buffer&& content)
        : data_(content.data()), size_(content.size()), block_(new block{std::move(content)}) {}
    shared_bytes(const shared_bytes& other) noexcept : data_(other.data_), size_(other.size_), block_(other.block_) {
        if (block_) ++block_->holders;
    }
    shared_bytes(shared_bytes&& other) noexcept
        : data_(other.data_), size_(other.size_), block_(std::exchange(other.block_, nullptr)) {}
    shared_bytes& operator=(const shared_bytes& other) noexcept { return *this = shared_bytes(other); }
    shared_bytes& operator=(shared_bytes&& other) noexcept {
        if (this == &other) return *this;
        let_go();
        data_ = other.data_;
        size_ = other.size_;
        block_ = std::exchange(other.block_, nullptr);
        return *this;
    }
    ~shared_bytes() { let_go(); }

    /// Whether there are any.
    explicit operator bool() const noexcept { return block_ != nullptr; }
    /// Of one that was moved from: unspecified.
    std::size_t size() const noexcept { return size_; }
    bytes_view view() const noexcept { return {data_, size_}; }
    /// The source of its large memory; null: the heap.
    large_memory_source* large_memory() const noexcept { return block_ ? block_->content.large_memory() : nullptr; }
    /// What lies behind the first `count` bytes.
    shared_bytes behind(std::size_t count) const noexcept {
        shared_bytes rest = *this;
        rest.drop_front(count);
        return rest;
    }
    void drop_front(std::size_t count) noexcept {
        data_ += count;
        size_ -= count;
    }
    void truncate(std::size_t size) noexcept { size_ = size; }
    /// Grows by `next` if that lies right behind it in the same memory.
    bool join(const shared_bytes& next) noexcept {
        if (next.block_ != block_ || next.data_ != data_ + size_) return false;
        size_ += next.size_;
        return true;
    }
    /// Grows by so many bytes that were made right behind it.
    void grow(std::size_t size) noexcept { size_ += size; }
    /// Whether it ends where `other` does, in the same memory.
    bool ends_with(const shared_bytes& other) const noexcept {
        return other.block_ == block_ && other.data_ + other.size_ == data_ + size_;
    }

private:
    friend class shared_bytes_maker;
    struct block {
        buffer content;
        std::size_t holders = 1;
    };
    void let_go() noexcept {
        if (block_ && --block_->holders == 0) destroy(block_);
    }
    static void destroy(block* unheld) noexcept;

    const std::byte* data_ = nullptr;
    std::size_t size_ = 0;
    block* block_ = nullptr;
};

/// Makes shared bytes of what was encoded. Small contents lie one behind the other in common chunks, so that a burst of
/// them does not cost an allocation each, and is a single stretch of memory for who wants them all; a chunk lives as
/// long as anything in it is shared, and is small for that reason. Chunks that nobody holds any more are used again,
/// and become larger only where what was made waits. A big content keeps the buffer that it was encoded into.
class shared_bytes_maker {
public:
    /// From now on large contents are made in memory of `large`, as long as it has some.
    void use(large_memory_source& large) {
        if (room_.large_memory() != &large) room_ = buffer(0, &large);
    }

    /// What is not longer than this lies in a chunk.
    static constexpr std::size_t small_bytes = 4 * 1024;

    /// An empty buffer to encode into; valid until `share()`.
    buffer& room() {
        room_.clear();
        if (last_big_ > room_.capacity()) room_.reserve(last_big_); // the next is likely as big
        return room_;
    }
    /// What is in the room, as shared bytes.
    shared_bytes share();
    /// Drops the content of the room, which was small, and the memory of a large one before it.
    void drop_small() {
        if (std::exchange(last_big_, 0) != 0) room_ = buffer(0, room_.large_memory());
    }
    /// So many bytes, uninitialized: `open()` and write every one of them.
    shared_bytes make(std::size_t size);
    /// The memory right behind `newest`, if that was made last; else none.
    std::span<std::byte> room_behind(const shared_bytes& newest) const noexcept {
        if (!newest || newest.block_ != chunk_.block_) return {};
        auto& chunk = chunk_.block_->content;
        auto* end = chunk.data() + chunk.size();
        if (newest.data_ + newest.size_ != end) return {};
        return {end, chunk.capacity() - chunk.size()};
    }
    /// So many bytes of that memory were written.
    void grow(std::size_t size) noexcept { chunk_.block_->content.grow(size); }
    /// To complete what was made here and nobody else has seen yet.
    static std::byte* open(const shared_bytes& made) noexcept { return const_cast<std::byte*>(made.data_); }

private:
    void next_chunk(std::size_t least);
    bool has_room(std::size_t size) const noexcept {
        return chunk_.block_ && chunk_.block_->content.capacity() - chunk_.block_->content.size() >= size;
    }

    buffer room_;             // knows where large contents are made
    shared_bytes chunk_;      // holds the chunk itself
    ring<shared_bytes> used_; // those before it, oldest first
    std::size_t chunk_bytes_ = 512;
    unsigned spared_ = 0; // so many times in a row there was one more than needed
    std::size_t last_big_ = 0;
};

} // namespace ise
