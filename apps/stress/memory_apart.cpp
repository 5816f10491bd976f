#include "memory_apart.hpp"

#include <cstdlib>
#include <new>

namespace atirma::stress {

std::pmr::memory_resource* memory_apart() {
    struct uncounted final : std::pmr::memory_resource {
        void* do_allocate(std::size_t bytes, std::size_t) override {
            // Of text, and maps and sets of plain values: aligned enough.
            if (void* block = std::malloc(bytes)) return block;
            throw std::bad_alloc();
        }
        void do_deallocate(void* block, std::size_t, std::size_t) override { std::free(block); }
        bool do_is_equal(const memory_resource& other) const noexcept override { return this == &other; }
    };
    static uncounted resource;
    return &resource;
}

} // namespace atirma::stress
