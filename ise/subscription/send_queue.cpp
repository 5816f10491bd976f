#include <ise/subscription/send_queue.hpp>

#include <ise/subscription/packet_frame.hpp>

#include <utility>

namespace ise {

void send_queue::begin_stretch(const shared_bytes& frame, std::uint32_t skipped, bool addressed) {
    stretches_.push_back({frame, 1, skipped, addressed, {}, 0, {}, {}});
}

void send_queue::push(const shared_packet& object, std::uint64_t sequence, wall_time published_at,
                      const trace_id& trace, std::uint32_t skipped) {
    ++packets_;
    cost_ += object.weight + item_bytes;
    stretches_.push_back({{}, 1, skipped, false, object, sequence, published_at, trace});
}

[[gnu::hot]] send_queue::stretch send_queue::pop(std::uint64_t most) {
    auto& oldest = stretches_.front();
    stretch taken;
    if (most >= oldest.packets) {
        taken = stretches_.pop_front();
    } else {
        const auto some = static_cast<std::size_t>(most);
        std::size_t length = 0;
        for (std::size_t i = 0; i < some; ++i) length += packet_frame::size_of(oldest.frames.view().data() + length);
        taken = oldest;
        taken.packets = some;
        taken.frames.truncate(length);
        oldest.frames.drop_front(length);
        oldest.packets -= some;
        oldest.skipped = 0;
    }
    packets_ -= taken.packets;
    cost_ -= taken.cost();
    return taken;
}

} // namespace ise
