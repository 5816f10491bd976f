#include <ise/transport/shm/blocks.hpp>

#include <ise/transport/shm/memory.hpp>

#include <algorithm>
#include <cstdint>
#include <utility>

#include <fcntl.h>
#include <sys/mman.h>

namespace ise::net::shm {
namespace {

using namespace std::chrono_literals;

// A block without use is freed after one or two of these.
constexpr duration look_period = 5s;
constexpr std::size_t min_block_bytes = 64 * 1024;

// A 256th of the machine's memory, within bounds: of one loop.
std::size_t pool_bytes_here() noexcept {
    constexpr std::uint64_t least = 16 * 1024 * 1024, most = max_loaned_bytes;
    return static_cast<std::size_t>(std::clamp<std::uint64_t>(machine_bytes() / 256, least, most));
}

// Null: the system refuses.
std::unique_ptr<block> make_block(std::size_t size) {
    auto made = std::make_unique<block>();
    auto memory = make_memory("ise-block", size);
    if (!memory || is_late(*memory)) return nullptr;
    made->memory = std::move(*memory);
    const int fd = made->memory.get();
    // Reserved: without memory left, writing to it would end the process.
    if (::fallocate(fd, 0, 0, static_cast<off_t>(size)) != 0) return nullptr;
    auto* at = ::mmap(nullptr, size, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0); // NOLINT
    if (at == MAP_FAILED) return nullptr;
    made->begin = static_cast<std::byte*>(at);
    made->size = size;
    // This mapping stays the only one that can write.
    if (::fcntl(fd, F_ADD_SEALS, demanded_seals | F_SEAL_FUTURE_WRITE) != 0) return nullptr;
    return made;
}

// Common to a loop.
struct pool_of_loop {
    std::shared_ptr<block_pool> pool;
    ~pool_of_loop() {
        if (pool) pool->leave_loop();
    }
};

} // namespace

block::~block() {
    if (begin) ::munmap(begin, size);
}

const std::shared_ptr<block_pool>& block_pool::of(loop& on) {
    auto& own = on.common<pool_of_loop>();
    if (!own.pool) own.pool = std::make_shared<block_pool>(on);
    return own.pool;
}

block_pool::block_pool(loop& on) : on_(on), look_(std::make_unique<timer>(on, [this] { look(); })) {}

block_pool::~block_pool() {
    while (!blocks_.empty()) free_one(blocks_.size() - 1);
}

std::span<std::byte> block_pool::take(std::size_t least) {
    auto* found = find_free(least);
    if (!found) {
        for (auto* user : users_) user->collect();
        found = find_free(least);
    }
    if (!found) found = make(least);
    if (!found) return {};
    found->taken = found->used = true;
    return {found->begin, found->size};
}

bool block_pool::give_back(const std::byte* at) noexcept {
    const auto found = std::ranges::find_if(blocks_, [at](const auto& one) { return one->begin == at; });
    if (found == blocks_.end()) return false;
    std::rotate(found, found + 1, blocks_.end());
    blocks_.back()->taken = false;
    if (blocks_.back()->retired) free_one(blocks_.size() - 1);
    return true;
}

void block_pool::add_buffer() noexcept {
    if (buffers_++ == 0) self_ = weak_from_this().lock();
}

void block_pool::remove_buffer() noexcept {
    if (--buffers_ == 0) auto perhaps_the_last = std::move(self_);
}

block* block_pool::find(const std::byte* at) const noexcept {
    for (const auto& one : blocks_)
        if (at >= one->begin && at < one->begin + one->size) return one.get();
    return nullptr;
}

// Frees those that are not in use, and were not since the last time.
void block_pool::look() {
    for (auto* user : users_) user->collect(); // what was returned since the last packet
    for (std::size_t place = blocks_.size(); place-- > 0;) {
        auto& one = *blocks_[place];
        if (!std::exchange(one.used, one.taken) && !one.taken) free_one(place);
    }
    if (!blocks_.empty()) look_later();
}

void block_pool::look_later() {
    if (look_) look_->arm(saturating_add(on_.now(), look_period));
}

// The smallest that suffices and is not far too large; of equal ones the one that was used last.
block* block_pool::find_free(std::size_t least) noexcept {
    block* best = nullptr;
    for (const auto& one : blocks_)
        if (!one->taken && one->size >= least && one->size / 4 <= std::max(least, min_block_bytes) &&
            (!best || one->size <= best->size))
            best = one.get();
    return best;
}

block* block_pool::make(std::size_t least) {
    static const std::size_t most = pool_bytes_here();
    constexpr std::size_t page = 4096;
    if (least > most / 2) return nullptr;
    const auto size = (std::max(least + least / 8, min_block_bytes) + page - 1) / page * page;
    for (std::size_t place = 0; blocks_.size() >= max_blocks || bytes_ + size > most;) {
        while (place < blocks_.size() && blocks_[place]->taken) ++place;
        if (place == blocks_.size()) return nullptr;
        free_one(place);
    }
    auto made = make_block(size);
    if (!made) return nullptr;
    if (blocks_.empty()) look_later();
    blocks_.push_back(std::move(made));
    bytes_ += size;
    return blocks_.back().get();
}

void block_pool::free_one(std::size_t place) noexcept {
    const auto gone = std::move(blocks_[place]);
    blocks_.erase(blocks_.begin() + static_cast<std::ptrdiff_t>(place));
    bytes_ -= gone->size;
    for (auto* user : users_) user->forget(*gone);
}

} // namespace ise::net::shm
