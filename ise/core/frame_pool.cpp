#include <ise/core/frame_pool.hpp>

#include <new>

#if defined(__has_feature)
    #if __has_feature(address_sanitizer)
        #define ISE_ASAN
    #endif
#endif
#if defined(__SANITIZE_ADDRESS__)
    #define ISE_ASAN
#endif
#if defined(ISE_ASAN)
    #include <sanitizer/asan_interface.h>
#endif

namespace ise {
namespace {

constexpr std::size_t step = 64, classes = 32;      // frames of up to 2 KiB
constexpr std::size_t kept_frame_bytes = 64 * 1024; // of each size

struct free_frame {
    free_frame* next;
};

// A kept frame is no coroutine any more: what still touches it is found.
void close_off([[maybe_unused]] free_frame* kept, [[maybe_unused]] std::size_t size) noexcept {
#if defined(ISE_ASAN)
    ASAN_POISON_MEMORY_REGION(kept + 1, size - sizeof *kept);
#endif
}
void open_again([[maybe_unused]] free_frame* kept, [[maybe_unused]] std::size_t size) noexcept {
#if defined(ISE_ASAN)
    ASAN_UNPOISON_MEMORY_REGION(kept, size);
#endif
}

// Trivial, so that it can be used at any time of its thread's life.
struct free_lists {
    free_frame* first[classes];
    std::size_t count[classes];
    bool open;   // whether the thread keeps frames
    bool closed; // it ends
};
constinit thread_local free_lists lists{};

struct closing {
    ~closing() {
        lists.open = false;
        lists.closed = true;
        for (auto& first : lists.first) {
            while (first) {
                auto* next = first->next;
                ::operator delete(first);
                first = next;
            }
        }
    }
};

void open_lists() {
    static thread_local closing at_end;
    static_cast<void>(at_end);
    lists.open = true;
}

constexpr std::size_t class_of(std::size_t size) { return (size - 1) / step; }

} // namespace

[[gnu::hot]] void* frame_pool::allocate(std::size_t size) {
    const auto which = class_of(size);
    if (which >= classes) return ::operator new(size);
    if (auto* kept = lists.first[which]) {
        lists.first[which] = kept->next;
        --lists.count[which];
        open_again(kept, (which + 1) * step);
        return kept;
    }
    return ::operator new((which + 1) * step);
}

[[gnu::hot]] void frame_pool::release(void* memory, std::size_t size) noexcept {
    const auto which = class_of(size);
    if (which >= classes) return ::operator delete(memory);
    if (!lists.open) {
        if (lists.closed) return ::operator delete(memory);
        open_lists();
    }
    if (lists.count[which] * (which + 1) * step >= kept_frame_bytes) return ::operator delete(memory);
    lists.first[which] = ::new (memory) free_frame{lists.first[which]};
    close_off(lists.first[which], (which + 1) * step);
    ++lists.count[which];
}

} // namespace ise
