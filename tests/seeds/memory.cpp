#include "memory.hpp"

#include <support/sanitizer.hpp>

#include <malloc.h>

#include <algorithm>
#include <cstdlib>
#include <new>

namespace {

thread_local seeds::memory_use use;

} // namespace

#if !TESTS_MEMORY_IS_SANITIZED

void* operator new(std::size_t size) {
    auto* made = std::malloc(size ? size : 1);
    if (!made) throw std::bad_alloc();
    use.now += malloc_usable_size(made);
    use.most = std::max(use.most, use.now);
    return made;
}
void* operator new(std::size_t size, std::align_val_t alignment) {
    auto step = static_cast<std::size_t>(alignment);
    auto* made = std::aligned_alloc(step, (size + step - 1) / step * step);
    if (!made) throw std::bad_alloc();
    use.now += malloc_usable_size(made);
    use.most = std::max(use.most, use.now);
    return made;
}
void operator delete(void* given) noexcept {
    if (given) use.now -= malloc_usable_size(given);
    std::free(given);
}
void operator delete(void* given, std::size_t) noexcept { operator delete(given); }
void operator delete(void* given, std::align_val_t) noexcept { operator delete(given); }
void operator delete(void* given, std::size_t, std::align_val_t) noexcept { operator delete(given); }

#endif

namespace seeds {

memory_use memory() noexcept { return use; }
void count_memory() noexcept { use.most = use.now; }
bool memory_is_counted() noexcept { return !TESTS_MEMORY_IS_SANITIZED; }

} // namespace seeds
