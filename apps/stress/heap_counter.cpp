// Replaces the program's operator new and delete by ones that count. One thread works here; nothing is atomic.
#include "heap_counter.hpp"

#include <cstdlib>
#include <malloc.h>
#include <new>

namespace {

atirma::stress::heap_use now;

void* counted(void* block) noexcept {
    if (!block) return nullptr;
    ++now.blocks;
    ++now.allocations;
    now.bytes += static_cast<std::int64_t>(malloc_usable_size(block));
    return block;
}
void* take(std::size_t size) {
    if (void* block = counted(std::malloc(size == 0 ? 1 : size))) return block;
    throw std::bad_alloc();
}
void* take(std::size_t size, std::align_val_t align) {
    const auto step = static_cast<std::size_t>(align);
    if (void* block = counted(std::aligned_alloc(step, (size + step - 1) / step * step))) return block;
    throw std::bad_alloc();
}
void give_back(void* block) noexcept {
    if (!block) return;
    --now.blocks;
    now.bytes -= static_cast<std::int64_t>(malloc_usable_size(block));
    std::free(block);
}

} // namespace

atirma::stress::heap_use atirma::stress::heap_now() noexcept { return now; }

void* operator new(std::size_t size) { return take(size); }
void* operator new[](std::size_t size) { return take(size); }
void* operator new(std::size_t size, std::align_val_t align) { return take(size, align); }
void* operator new[](std::size_t size, std::align_val_t align) { return take(size, align); }
void operator delete(void* block) noexcept { give_back(block); }
void operator delete[](void* block) noexcept { give_back(block); }
void operator delete(void* block, std::size_t) noexcept { give_back(block); }
void operator delete[](void* block, std::size_t) noexcept { give_back(block); }
void operator delete(void* block, std::align_val_t) noexcept { give_back(block); }
void operator delete[](void* block, std::align_val_t) noexcept { give_back(block); }
void operator delete(void* block, std::size_t, std::align_val_t) noexcept { give_back(block); }
void operator delete[](void* block, std::size_t, std::align_val_t) noexcept { give_back(block); }
