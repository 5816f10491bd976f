#include <ise/subscription/send_queue.hpp>

#include <ise/subscription/packet_frame.hpp>

#include <utility>

namespace ise {

send_queue::stretch send_queue::pop(std::size_t most) {
    auto& oldest = stretches_.front();
    stretch taken;
    if (most >= oldest.packets) {
        taken = stretches_.pop_front();
    } else {
        std::size_t length = 0;
        for (std::size_t i = 0; i < most; ++i) length += packet_frame::size_of(oldest.frames.view().data() + length);
        taken = oldest;
        taken.packets = most;
        taken.frames.truncate(length);
        oldest.frames.drop_front(length);
        oldest.packets -= most;
        oldest.skipped = 0;
    }
    packets_ -= taken.packets;
    cost_ -= taken.cost();
    return taken;
}

} // namespace ise
