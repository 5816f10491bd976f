#include <ise/net/batch.hpp>

#include <utility>

namespace ise::net {
namespace {

// A burst must not pin its memory for the life of a connection; what is filled again and again keeps it, or every
// turn would get fresh pages from the kernel.
constexpr std::size_t kept_capacity = 256 * 1024;
// More are in use only where several sockets are full.
constexpr std::size_t kept_batches = 2;

void recycle(buffer& used) {
    if (used.capacity() > kept_capacity && used.size() < used.capacity() / 4) used = buffer();
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

void batch::share(shared_bytes owner, bytes_view content) {
    owners_.push_back(std::move(owner));
    refer_to(content);
}

void batch::refer_to(bytes_view content) {
    close_staged();
    segment made;
    made.size = content.size();
    made.data = content.data();
    segments_.push_back(made);
    shared_bytes_ += content.size();
}

void batch::adopt(buffer& content) {
    std::swap(adopted_, content);
    content.clear();
    refer_to(adopted_.view());
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

void batch::visit_unwritten(const std::function<void(const wire::frame&)>& visit) {
    std::size_t segment_at = 0; // where the segment begins in the whole
    std::size_t frame_at = 0;   // where the next frame does
    auto look = [&](bytes_view content) {
        // Headers are never split: they are put down together with what follows them in the staging buffer.
        while (frame_at < segment_at + content.size()) {
            auto rest = content.subspan(frame_at - segment_at);
            auto header = wire::read_header(rest.data());
            std::size_t size = wire::frame_header::size + header.length;
            passed_object object;
            if ((header.flags & wire::flag::beside) && !beside_.empty()) object = beside_.pop_front();
            if (frame_at >= written_ && size <= rest.size()) visit({header, rest.subspan(wire::frame_header::size, header.length), object ? &object : nullptr});
            frame_at += size;
        }
        segment_at += content.size();
    };
    for (const auto& part : segments_) look({part.data ? part.data : staging_.data() + part.begin, part.size});
    look(staging_.view().subspan(staged_));
}

void batch::clear() {
    recycle(staging_);
    recycle(adopted_);
    segments_.clear();
    owners_.clear();
    if (!beside_.empty()) beside_.clear();
    beside_weight_ = 0;
    staged_ = shared_bytes_ = written_ = 0;
}

std::unique_ptr<batch> batch_pool::lend() {
    if (unused_.empty()) return std::make_unique<batch>();
    auto lent = std::move(unused_.back());
    unused_.pop_back();
    return lent;
}

void batch_pool::take_back(std::unique_ptr<batch> unused) {
    if (unused_.size() < kept_batches) unused_.push_back(std::move(unused));
}

} // namespace ise::net
