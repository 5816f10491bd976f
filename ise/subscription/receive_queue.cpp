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

} // namespace ise
