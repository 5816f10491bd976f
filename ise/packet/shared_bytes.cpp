#include <ise/packet/shared_bytes.hpp>

#include <cstring>

namespace ise {
namespace {

constexpr std::size_t chunk_bytes = 4 * 1024;
constexpr std::size_t small_bytes = 1024;

} // namespace

buffer& shared_bytes_maker::room() {
    room_.clear();
    if (last_big_ > room_.capacity()) room_.reserve(last_big_); // the next is likely as big
    return room_;
}

shared_bytes shared_bytes_maker::share() {
    const auto size = room_.size();
    if (size > small_bytes) {
        last_big_ = size;
        auto owner = std::make_shared<buffer>(std::move(room_));
        room_ = buffer();
        const std::byte* data = owner->data();
        return {std::shared_ptr<const std::byte>(std::move(owner), data), size};
    }
    last_big_ = 0;
    if (!chunk_ || chunk_bytes - used_ < size) {
        chunk_ = std::make_shared_for_overwrite<std::byte[]>(chunk_bytes);
        used_ = 0;
    }
    std::byte* at = chunk_.get() + used_;
    if (size > 0) std::memcpy(at, room_.data(), size);
    used_ += size;
    return {std::shared_ptr<const std::byte>(chunk_, at), size};
}

} // namespace ise
