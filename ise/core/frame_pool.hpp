#pragma once
#include <cstddef>

namespace ise {

/// Memory of coroutines' frames and of what starts them: each thread keeps what it freed for the next ones, as
/// coroutines come and go with every packet. Bounded; freed on another thread it stays there.
class frame_pool {
public:
    static void* allocate(std::size_t size);
    static void release(void* memory, std::size_t size) noexcept;
};

} // namespace ise
