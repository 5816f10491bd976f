#include <ise/subscription/receive_queue.hpp>

#include <algorithm>

namespace ise {

void receive_queue::make_room(std::size_t more) {
    const auto waiting = content_.view().subspan(begin_);
    if (begin_ > content_.capacity() / 2 && content_.capacity() - waiting.size() >= more) {
        std::memmove(content_.data(), waiting.data(), waiting.size());
        content_.truncate(waiting.size());
    } else {
        buffer grown(std::max(waiting.size() + more, content_.capacity() * 2));
        grown.append(waiting);
        content_ = std::move(grown);
    }
    begin_ = 0;
}

// Removes the object and the trace of the oldest packet; returns the number of packets lost before it.
std::uint64_t receive_queue::pop_marked() noexcept {
    if (front_marks() & object_mark) auto gone = objects_.pop_front();
    if (front_marks() & traced_mark) traces_.pop_front();
    return packet_frame::id_of(front_frame());
}

// A burst's room is given back when the queue has been emptied some times in a row with little in it.
void receive_queue::drained() noexcept {
    if (content_.capacity() <= kept_bytes || begin_ >= content_.capacity() / 16) little_ = 0;
    else if (++little_ == little_before_freed) content_ = buffer();
    content_.clear();
    begin_ = 0;
}

} // namespace ise
