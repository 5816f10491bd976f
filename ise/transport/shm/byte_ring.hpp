#pragma once
#include <asio/buffer.hpp>

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <span>

/// One direction of a shared-memory connection: bytes from one process to another, which trusts nothing in the memory.
/// Each side keeps its own position for itself, and checks that of the other one; what is read was copied before.
///
/// Nobody is woken who does not sleep: a side says in the memory that it is going to sleep, and then looks once more;
/// the other side moves its position, and then looks whether somebody sleeps. All four accesses are sequentially
/// consistent, so that one of the two sees the other.
namespace ise::net::shm {

inline constexpr std::size_t returned_words = 2;

/// What the two sides of a ring tell each other; zero at the start. `Word`: an atomic 32-bit number without locks.
template <class Word>
struct basic_ring_state {
    // Written by the writer.
    alignas(128) Word head; ///< bytes written, modulo 2^32
    Word ended;             ///< 1: nothing more will be written
    Word writer_sleeps;     ///< 1: ring the writer once there is room; cleared by whoever rings
    alignas(128) Word tail; ///< written by the reader: bytes read, modulo 2^32
    Word reader_sleeps;     ///< 1: ring the reader once there are bytes; cleared by whoever rings
    /// Blocks of the writer (`loans`) that the reader has given back, a bit for each slot; cleared by the writer.
    Word returned[returned_words];
};

/// `size`: a power of two. Used by one thread at a time.
template <class Word>
class basic_ring_writer {
public:
    basic_ring_writer(basic_ring_state<Word>& shared, std::byte* content, std::uint32_t size) noexcept
        : shared_(&shared), content_(content), size_(size), limit_(size) {}

    /// At most so many bytes lie in the ring, from now on.
    void limit(std::size_t bytes) noexcept {
        limit_ = static_cast<std::uint32_t>(std::clamp<std::size_t>(bytes, 1, size_));
    }

    /// Copies what there is room for, and returns its size; nothing: the reader's position cannot be. `ring`: the
    /// reader sleeps, and has to be woken.
    std::optional<std::size_t> write(std::span<const asio::const_buffer> from, bool& ring) {
        auto head = head_.load(std::memory_order_relaxed);
        std::uint32_t room = 0;
        std::size_t wanted = 0;
        for (const auto& piece : from) wanted += piece.size();
        if (wanted > (room = room_behind(head, known_tail_))) {
            known_tail_ = shared_->tail.load(std::memory_order_acquire);
            if (head - known_tail_ > size_) return std::nullopt;
            room = room_behind(head, known_tail_);
        }
        const auto before = head;
        for (const auto& piece : from) {
            const auto count = static_cast<std::uint32_t>(std::min<std::size_t>(piece.size(), room));
            put(head, static_cast<const std::byte*>(piece.data()), count);
            head += count;
            room -= count;
        }
        if (head == before) return 0;
        head_.store(head, std::memory_order_relaxed);
        shared_->head.store(head);
        ring = reader_sleeps();
        return head - before;
    }

    /// Says that nothing follows. Whether the reader sleeps.
    bool end() {
        shared_->ended.store(1);
        return reader_sleeps();
    }

    /// Whether a good piece of room is there; else the writer is rung once that may be so. Nothing: as `write`.
    std::optional<bool> sleep_until_room() {
        shared_->writer_sleeps.store(1);
        const auto used = head_.load(std::memory_order_relaxed) - shared_->tail.load();
        if (used > size_) return std::nullopt;
        if (used > limit_ - limit_ / 4) return false;
        if (used == limit_) return false;
        shared_->writer_sleeps.store(0, std::memory_order_relaxed);
        return true;
    }

private:
    std::uint32_t room_behind(std::uint32_t head, std::uint32_t tail) const noexcept {
        return limit_ - std::min(limit_, head - tail);
    }
    void put(std::uint32_t at, const std::byte* from, std::uint32_t count) noexcept {
        if (count == 0) return;
        const auto place = at & (size_ - 1);
        const auto first = std::min(count, size_ - place);
        std::memcpy(content_ + place, from, first);
        std::memcpy(content_, from + first, count - first);
    }
    bool reader_sleeps() { return shared_->reader_sleeps.load() != 0 && shared_->reader_sleeps.exchange(0) != 0; }

    basic_ring_state<Word>* shared_;
    std::byte* content_;
    std::uint32_t size_;
    std::uint32_t limit_;
    std::uint32_t known_tail_ = 0;
    std::atomic<std::uint32_t> head_{0}; // another thread may show a sign of life
};

/// `size`: a power of two. Used by one thread at a time.
template <class Word>
class basic_ring_reader {
public:
    basic_ring_reader(basic_ring_state<Word>& shared, const std::byte* content, std::uint32_t size) noexcept
        : shared_(&shared), content_(content), size_(size) {}

    /// Copies what there is, and returns its size; 0: nothing yet, or `ended()`. Nothing: the writer's position cannot
    /// be. `ring`: the writer waits for room, and has to be woken.
    std::optional<std::size_t> read(std::span<std::byte> into, bool& ring) {
        const auto there = shared_->head.load(std::memory_order_acquire) - tail_;
        if (there > size_) return std::nullopt;
        const auto count = static_cast<std::uint32_t>(std::min<std::size_t>(into.size(), there));
        if (count == 0) return 0;
        const auto place = tail_ & (size_ - 1);
        const auto first = std::min(count, size_ - place);
        std::memcpy(into.data(), content_ + place, first);
        std::memcpy(into.data() + first, content_, count - first);
        tail_ += count;
        shared_->tail.store(tail_);
        // A writer that waits is woken for a good piece of room, not for each byte.
        ring = shared_->writer_sleeps.load() != 0 && size_ - (there - count) >= size_ / 4 &&
               shared_->writer_sleeps.exchange(0) != 0;
        return count;
    }

    /// Whether `read` would bring something, or the end is there.
    bool ready() const {
        return shared_->head.load(std::memory_order_acquire) != tail_ ||
               shared_->ended.load(std::memory_order_acquire) != 0;
    }
    /// The writer ended, and everything was read.
    bool ended() const { return shared_->ended.load() != 0 && shared_->head.load() == tail_; }

    /// From now on the reader is rung. False: it need not sleep, something is there.
    bool sleep() {
        shared_->reader_sleeps.store(1);
        if (shared_->head.load() == tail_ && shared_->ended.load() == 0) return true;
        shared_->reader_sleeps.store(0, std::memory_order_relaxed);
        return false;
    }

private:
    basic_ring_state<Word>* shared_;
    const std::byte* content_;
    std::uint32_t size_;
    std::uint32_t tail_ = 0;
};

using ring_word = std::atomic<std::uint32_t>;
static_assert(ring_word::is_always_lock_free);
using ring_state = basic_ring_state<ring_word>;
using ring_writer = basic_ring_writer<ring_word>;
using ring_reader = basic_ring_reader<ring_word>;

} // namespace ise::net::shm
