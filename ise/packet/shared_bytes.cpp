#include <ise/packet/shared_bytes.hpp>

#include <cstring>

namespace ise {
namespace {

constexpr std::size_t chunk_bytes = 4 * 1024;
constexpr std::size_t small_bytes = 1024;

} // namespace

void shared_bytes::destroy(block* unheld) noexcept { delete unheld; }

void shared_bytes_maker::next_chunk() {
    std::swap(chunk_, spare_);
    if (chunk_.block_ && chunk_.block_->holders == 1) {
        chunk_.block_->content.clear();
    } else {
        chunk_ = shared_bytes(buffer(chunk_bytes));
    }
}

shared_bytes shared_bytes_maker::share() {
    const auto size = room_.size();
    if (size > small_bytes) {
        last_big_ = size;
        return shared_bytes(std::exchange(room_, buffer()));
    }
    last_big_ = 0;
    if (!chunk_.block_ || chunk_bytes - chunk_.block_->content.size() < size) next_chunk();
    shared_bytes made = chunk_;
    std::byte* at = chunk_.block_->content.grow(size);
    if (size > 0) std::memcpy(at, room_.data(), size);
    made.data_ = at;
    made.size_ = size;
    return made;
}

} // namespace ise
