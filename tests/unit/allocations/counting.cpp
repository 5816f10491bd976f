#include "counting.hpp"

#include <atomic>
#include <cstdlib>
#include <new>

extern "C" void* __real_malloc(std::size_t);
extern "C" void* __real_realloc(void*, std::size_t);

namespace {

std::atomic<std::uint64_t> count{0};
std::atomic<std::int64_t> until_refused{-1};        // negative: none is
std::atomic<std::int64_t> until_growth_refused{-1}; // the same
std::atomic<std::uint64_t> grown{0};
std::atomic<std::uint64_t> grown_large{0};
std::atomic<std::size_t> largest{0};

void* counted(std::size_t size, std::size_t alignment = 0) noexcept {
    ++count;
    if (until_refused.load(std::memory_order_relaxed) >= 0 && until_refused-- == 0) return nullptr;
    if (alignment == 0) return __real_malloc(size > 0 ? size : 1);
    return std::aligned_alloc(alignment, (size + alignment - 1) / alignment * alignment);
}

// False: it is refused.
bool note_growth(std::size_t size) noexcept {
    ++grown;
    if (size >= 4096) ++grown_large;
    if (size > largest) largest = size;
    return until_growth_refused.load(std::memory_order_relaxed) < 0 || until_growth_refused-- != 0;
}

void* sure(void* made) {
    if (!made) throw std::bad_alloc();
    return made;
}

// Not inlined: g++ 14 would take these for two allocators that do not belong together.
[[gnu::noinline]] void give_back(void* made) noexcept { std::free(made); }

} // namespace

std::uint64_t ise_test::allocations() noexcept { return count; }
void ise_test::refuse_allocation_after(std::int64_t others) noexcept { until_refused = others; }
void ise_test::refuse_no_allocation() noexcept { until_refused = -1; }
void ise_test::refuse_growth_after(std::int64_t others) noexcept { until_growth_refused = others; }
void ise_test::refuse_no_growth() noexcept { until_growth_refused = -1; }
std::uint64_t ise_test::reallocations() noexcept { return grown; }
std::uint64_t ise_test::large_reallocations() noexcept { return grown_large; }
std::size_t ise_test::take_largest_reallocation() noexcept { return largest.exchange(0); }

// link.cmake
extern "C" void* __wrap_malloc(std::size_t size) { return note_growth(size) ? __real_malloc(size) : nullptr; }
extern "C" void* __wrap_realloc(void* old, std::size_t size) {
    return note_growth(size) ? __real_realloc(old, size) : nullptr;
}

// All of them: a sanitizer brings its own, which must not meet these.
void* operator new(std::size_t size) { return sure(counted(size)); }
void* operator new[](std::size_t size) { return sure(counted(size)); }
void* operator new(std::size_t size, const std::nothrow_t&) noexcept { return counted(size); }
void* operator new[](std::size_t size, const std::nothrow_t&) noexcept { return counted(size); }
void* operator new(std::size_t size, std::align_val_t alignment) {
    return sure(counted(size, static_cast<std::size_t>(alignment)));
}
void* operator new[](std::size_t size, std::align_val_t alignment) {
    return sure(counted(size, static_cast<std::size_t>(alignment)));
}
void operator delete(void* made) noexcept { give_back(made); }
void operator delete[](void* made) noexcept { give_back(made); }
void operator delete(void* made, std::size_t) noexcept { give_back(made); }
void operator delete[](void* made, std::size_t) noexcept { give_back(made); }
void operator delete(void* made, std::align_val_t) noexcept { give_back(made); }
void operator delete[](void* made, std::align_val_t) noexcept { give_back(made); }
void operator delete(void* made, std::size_t, std::align_val_t) noexcept { give_back(made); }
void operator delete[](void* made, std::size_t, std::align_val_t) noexcept { give_back(made); }
