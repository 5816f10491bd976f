#include <ise/core/buffer.hpp>

#include <algorithm>
#include <cstdlib>
#include <new>

namespace ise {

buffer::~buffer() { std::free(data_); }

void buffer::enlarge(std::size_t more) {
    if (more > SIZE_MAX / 2 - size_) throw std::bad_alloc();
    std::size_t capacity = std::max({size_ + more, capacity_ * 2, std::size_t{32}});
    void* moved = std::realloc(data_, capacity);
    if (!moved) throw std::bad_alloc();
    data_ = static_cast<std::byte*>(moved);
    capacity_ = capacity;
}

} // namespace ise
