#include <ise/core/buffer.hpp>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <new>

namespace ise {
namespace {

struct block {
    std::byte* at = nullptr;
    std::size_t capacity = 0;
};

// What big buffers leave behind serves the next ones of the thread. From and to malloc, each big message would have its
// pages taken from the system and given back, which costs more than copying it.
class spare_blocks {
public:
    static constexpr std::size_t min_bytes = 64 * 1024;
    static constexpr std::size_t max_bytes = 16 * 1024 * 1024; // all together

    ~spare_blocks() {
        ended = true;
        for (auto& one : kept_) std::free(one.at);
    }

    /// The smallest that suffices and is not far too large; none if there is none.
    block take(std::size_t least) noexcept {
        block* best = nullptr;
        for (auto& one : kept_)
            if (one.capacity >= least && one.capacity / 4 <= least && (!best || one.capacity < best->capacity))
                best = &one;
        if (!best) return {};
        bytes_ -= best->capacity;
        return std::exchange(*best, {});
    }
    /// Keeps it, or in its place the one that it takes the room of.
    block keep(block one) noexcept {
        auto& smallest = *std::min_element(kept_.begin(), kept_.end(),
                                           [](const block& a, const block& b) { return a.capacity < b.capacity; });
        if (smallest.capacity >= one.capacity || bytes_ - smallest.capacity + one.capacity > max_bytes) return one;
        bytes_ += one.capacity - smallest.capacity;
        return std::exchange(smallest, one);
    }

    // Buffers may outlive it: those of statics.
    static thread_local bool ended;

private:
    std::array<block, 4> kept_{};
    std::size_t bytes_ = 0;
};

thread_local bool spare_blocks::ended = false;
thread_local spare_blocks spare;

void release(block unused) noexcept {
    if (unused.capacity >= spare_blocks::min_bytes && !spare_blocks::ended) unused = spare.keep(unused);
    std::free(unused.at);
}

} // namespace

void buffer::free() noexcept { release({data_, capacity_}); }

void buffer::enlarge(std::size_t more) {
    if (more > SIZE_MAX / 2 - size_) throw std::bad_alloc();
    std::size_t capacity = std::max({size_ + more, capacity_ * 2, std::size_t{32}});
    if (capacity >= spare_blocks::min_bytes && !spare_blocks::ended) {
        if (const auto found = spare.take(capacity); found.at) {
            if (size_ > 0) std::memcpy(found.at, data_, size_);
            if (data_) release({data_, capacity_});
            data_ = found.at;
            capacity_ = found.capacity;
            return;
        }
    }
    void* moved = std::realloc(data_, capacity);
    if (!moved) throw std::bad_alloc();
    data_ = static_cast<std::byte*>(moved);
    capacity_ = capacity;
}

} // namespace ise
