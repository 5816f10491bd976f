#include <ise/subscription/receive_queue.hpp>

#include <algorithm>

namespace ise {
namespace {

// What a burst took beyond this is given back when the queue has been emptied with little in it.
constexpr std::size_t kept_queue_bytes = 4 * 1024;

} // namespace

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

void receive_queue::drained() noexcept {
    if (content_.capacity() > kept_queue_bytes && begin_ < content_.capacity() / 8) content_ = buffer();
    content_.clear();
    begin_ = 0;
}

} // namespace ise
