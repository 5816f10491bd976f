#include <ise/core/buffer.hpp>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdlib>
#include <new>

#ifdef __linux__
    #include <sys/mman.h>
#endif

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
    static constexpr std::size_t max_bytes = 32 * 1024 * 1024; // all together

    ~spare_blocks() {
        ended = true;
        for (std::size_t at = 0; at < count_; ++at) std::free(kept_[at].at);
    }

    /// The smallest that suffices and is not far too large, and of these the last one; none if there is none.
    block take(std::size_t least) noexcept {
        std::size_t best = count_;
        for (std::size_t at = 0; at < count_; ++at)
            if (kept_[at].capacity >= least && kept_[at].capacity / 4 <= least &&
                (best == count_ || kept_[at].capacity <= kept_[best].capacity))
                best = at;
        return best < count_ ? remove(best) : block();
    }
    /// Keeps it, in place of those that have not served for longest.
    void keep(block one) noexcept {
        if (one.capacity > max_bytes) return std::free(one.at);
        while (count_ == kept_.size() || bytes_ + one.capacity > max_bytes) std::free(remove(0).at);
        bytes_ += one.capacity;
        kept_[count_++] = one;
    }

    // Buffers may outlive it: those of statics.
    static thread_local bool ended;

private:
    block remove(std::size_t at) noexcept {
        const auto removed = kept_[at];
        std::copy(kept_.begin() + at + 1, kept_.begin() + count_, kept_.begin() + at);
        --count_;
        bytes_ -= removed.capacity;
        return removed;
    }

    std::array<block, 32> kept_{}; // oldest first
    std::size_t count_ = 0;
    std::size_t bytes_ = 0;
};

thread_local bool spare_blocks::ended = false;
thread_local spare_blocks spare;

void release(block unused) noexcept {
    if (unused.capacity >= spare_blocks::min_bytes && !spare_blocks::ended) spare.keep(unused);
    else std::free(unused.at);
}

// Large ones in huge pages: to get them from the system page by page costs more than to fill them.
block make_block(std::size_t capacity) {
    block made{static_cast<std::byte*>(std::malloc(capacity)), capacity};
    if (!made.at) throw std::bad_alloc();
#ifdef MADV_HUGEPAGE
    constexpr std::size_t page = 4096, large = 4 * 1024 * 1024;
    if (capacity < large) return made;
    const auto beyond_page = reinterpret_cast<std::uintptr_t>(made.at) % page;
    const auto skipped = beyond_page == 0 ? 0 : page - beyond_page;
    ::madvise(made.at + skipped, (capacity - skipped) / page * page, MADV_HUGEPAGE); // no more than advice
#endif
    return made;
}

} // namespace

void buffer::free() noexcept {
    if (!large_ || !large_->give_back(data_)) release({data_, capacity_});
}

void buffer::enlarge(std::size_t more) {
    if (more > SIZE_MAX / 2 - size_) throw std::bad_alloc();
    const std::size_t capacity = std::max({size_ + more, capacity_ * 2, std::size_t{32}});
    block larger;
    const bool small = capacity < spare_blocks::min_bytes || spare_blocks::ended;
    if (small && !large_) {
        larger = {static_cast<std::byte*>(std::realloc(data_, capacity)), capacity};
        if (!larger.at) throw std::bad_alloc();
    } else {
        if (large_ && capacity >= large_memory_source::min_bytes) {
            const auto taken = large_->take(capacity);
            larger = {taken.data(), taken.size()};
        }
        if (!larger.at && !small) larger = spare.take(capacity);
        if (!larger.at) larger = make_block(capacity);
        if (size_ > 0) std::memcpy(larger.at, data_, size_);
        if (data_) free();
    }
    data_ = larger.at;
    capacity_ = larger.capacity;
}

} // namespace ise
