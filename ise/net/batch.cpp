#include <ise/net/batch.hpp>

#include <utility>

namespace ise::net {

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

void batch::adopt_behind(buffer& content) {
    std::swap(adopted_, content);
    content.clear();
    refer_to(adopted_.view());
}

std::span<const asio::const_buffer> batch::remaining_segments() {
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

buffer& batch::gather() {
    gathered_.clear();
    gathered_.reserve(bytes());
    for (const auto& part : remaining_segments())
        gathered_.append({static_cast<const std::byte*>(part.data()), part.size()});
    return gathered_;
}

void batch::visit_unwritten(const std::function<void(const carried_frame&)>& visit) {
    std::size_t segment_at = 0; // where the segment begins in the whole
    std::size_t frame_at = 0;   // where the next frame does
    auto look = [&](bytes_view content) {
        // Headers are never split: they are put down together with what follows them in the staging buffer.
        while (frame_at < segment_at + content.size()) {
            auto rest = content.subspan(frame_at - segment_at);
            auto header = wire::read_header(rest.data());
            std::size_t size = wire::frame_header::size + header.length;
            passed_object object;
            if ((header.flags & wire::flag::attached) && !attachments_.empty()) object = attachments_.pop_front();
            if (frame_at >= written_ && size <= rest.size()) {
                carried_frame one;
                one.header = header;
                one.body = rest.subspan(wire::frame_header::size, header.length);
                one.object = object ? &object : nullptr;
                visit(one);
            }
            frame_at += size;
        }
        segment_at += content.size();
    };
    for (const auto& part : segments_) look({part.data ? part.data : staging_.data() + part.begin, part.size});
    look(staging_.view().subspan(staged_));
}

void batch::clear() {
    staging_.recycle();
    if (!segments_.empty()) {
        adopted_.recycle();
        gathered_.recycle();
        segments_.clear();
        owners_.clear();
        staged_ = shared_bytes_ = 0;
    }
    if (!attachments_.empty()) attachments_.clear();
    attached_weight_ = written_ = 0;
}

} // namespace ise::net
