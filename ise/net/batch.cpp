#include <ise/net/batch.hpp>

#include <utility>

namespace ise::net {
namespace {

// A burst must not pin its memory for the life of a connection.
constexpr std::size_t kept_capacity = 256 * 1024;

void recycle(buffer& used) {
    if (used.capacity() > kept_capacity) used = buffer();
    used.clear();
}

} // namespace

void batch::close_staged() {
    if (staging_.size() == staged_) return;
    segment made;
    made.begin = staged_;
    made.size = staging_.size() - staged_;
    segments_.push_back(made);
    staged_ = staging_.size();
}

void batch::share(std::shared_ptr<const void> owner, bytes_view content) {
    close_staged();
    segment made;
    made.size = content.size();
    made.data = content.data();
    segments_.push_back(made);
    if (owner) owners_.push_back(std::move(owner));
    shared_bytes_ += content.size();
}

void batch::adopt(buffer& content) {
    std::swap(adopted_, content);
    content.clear();
    share(nullptr, adopted_.view());
}

std::span<const asio::const_buffer> batch::remaining() {
    close_staged();
    views_.clear();
    std::size_t skip = written_;
    for (const auto& part : segments_) {
        if (skip >= part.size) {
            skip -= part.size;
            continue;
        }
        const std::byte* data = part.data ? part.data : staging_.data() + part.begin;
        views_.emplace_back(data + skip, part.size - skip);
        skip = 0;
    }
    return views_;
}

void batch::clear() {
    recycle(staging_);
    recycle(adopted_);
    segments_.clear();
    owners_.clear();
    staged_ = shared_bytes_ = written_ = 0;
}

} // namespace ise::net
