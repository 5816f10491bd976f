#pragma once
#include <cstddef>

namespace seeds {

/// Memory that this thread has from the program's heap, where it is counted (not under sanitizers).
struct memory_use {
    std::size_t now = 0;
    std::size_t most = 0; ///< since `count_memory()`
};
memory_use memory() noexcept;
void count_memory() noexcept;
bool memory_is_counted() noexcept;

} // namespace seeds
