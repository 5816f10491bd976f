#include <ise/packet/shared_bytes.hpp>

#include <algorithm>
#include <cstring>

namespace ise {
namespace {

constexpr std::size_t max_chunk = 16 * 1024;
// So many chunks are looked after: what is sent in one go, or kept for a lossless subscriber, lies in fewer.
constexpr std::size_t kept_chunks = 64;
// One that could be spared that often in a row is given back.
constexpr unsigned spared_before_freed = 1000;

} // namespace

void shared_bytes::destroy(block* unheld) noexcept { delete unheld; }

void shared_bytes_maker::next_chunk(std::size_t least) {
    if (chunk_.block_) used_.push_back(std::move(chunk_));
    auto unheld = [this](std::size_t place) { return used_.size() > place && used_[place].block_->holders == 1; };
    spared_ = unheld(1) ? spared_ + 1 : 0;
    if (spared_ == spared_before_freed) {
        auto freed = used_.pop_front();
        spared_ = 0;
    }
    if (unheld(0)) {
        chunk_ = used_.pop_front();
        chunk_.block_->content.clear();
        if (has_room(least)) return;
    } else if (used_.size() == kept_chunks) {
        auto lives_without_us = used_.pop_front();
    }
    chunk_bytes_ = std::clamp(chunk_bytes_ * 2, least, std::max(least, max_chunk));
    chunk_ = shared_bytes(buffer(chunk_bytes_));
}

shared_bytes shared_bytes_maker::share() {
    const auto size = room_.size();
    if (size > small_bytes) {
        last_big_ = size;
        return shared_bytes(std::exchange(room_, buffer(0, room_.large_memory())));
    }
    auto made = make(size);
    if (size > 0) std::memcpy(open(made), room_.data(), size);
    drop_small();
    return made;
}

shared_bytes shared_bytes_maker::make(std::size_t size) {
    if (size > small_bytes) {
        buffer own(size, room_.large_memory());
        own.grow(size);
        return shared_bytes(std::move(own));
    }
    if (!has_room(size)) next_chunk(size);
    shared_bytes made = chunk_;
    made.data_ = chunk_.block_->content.grow(size);
    made.size_ = size;
    return made;
}

} // namespace ise
