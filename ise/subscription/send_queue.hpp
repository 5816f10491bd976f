#pragma once
#include <ise/core/ring.hpp>
#include <ise/core/time.hpp>
#include <ise/core/trace_id.hpp>
#include <ise/packet/packet_object.hpp>
#include <ise/packet/shared_bytes.hpp>

#include <cstdint>

namespace ise {

/// The packets that wait for one subscriber, as frames (`packet_frame`). Those that were published one after the other
/// lie one behind the other in memory: they wait, and leave, as one stretch, however many they are. For a subscriber
/// within the process they wait as objects, each a stretch of its own.
class send_queue {
public:
    struct stretch {
        shared_bytes frames;
        std::size_t packets = 0;
        std::uint32_t skipped = 0;  ///< by the rate limit, before the first of them
        bool addressed = false;     ///< they bear the number of this subscription
        shared_packet object;       ///< in place of the frame
        std::uint64_t sequence = 0; ///< of the object
        wall_time published_at{};   ///< the object
        trace_id trace;             ///< of the object

        std::size_t cost() const noexcept { return frames.size() + object.weight + packets * item_bytes; }
    };
    /// What holding a packet costs beside its frame.
    static constexpr std::size_t item_bytes = 40;

    bool empty() const noexcept { return packets_ == 0; }
    std::size_t size() const noexcept { return packets_; }
    std::size_t cost() const noexcept { return cost_; }

    void push(const shared_bytes& frame, std::uint32_t skipped, bool addressed) {
        ++packets_;
        cost_ += frame.size() + item_bytes;
        if (!stretches_.empty() && skipped == 0) {
            auto& last = stretches_[stretches_.size() - 1];
            if (last.addressed == addressed && last.frames.join(frame)) {
                ++last.packets;
                return;
            }
        }
        begin_stretch(frame, skipped, addressed);
    }
    void push(stretch whole) {
        packets_ += whole.packets;
        cost_ += whole.cost();
        stretches_.push_back(std::move(whole));
    }
    void push(const shared_packet& object, std::uint64_t sequence, wall_time published_at, const trace_id& trace,
              std::uint32_t skipped);

    /// Whether its newest stretch has more than one packet, the last of which is this one.
    bool ends_with_run(const shared_bytes& frame) const noexcept {
        if (stretches_.empty()) return false;
        const auto& last = stretches_[stretches_.size() - 1];
        return last.packets > 1 && last.frames.ends_with(frame);
    }
    /// So many packets lie behind the newest stretch, and belong to it.
    void extend(std::size_t packets, std::size_t size) noexcept {
        auto& last = stretches_[stretches_.size() - 1];
        last.packets += packets;
        last.frames.grow(size);
        packets_ += packets;
        cost_ += size + packets * item_bytes;
    }

    /// The oldest; only where there is one.
    const stretch& front() const noexcept { return stretches_.front(); }
    /// Takes the first `most` packets of the oldest stretch.
    stretch pop(std::uint64_t most);
    /// What was skipped before a packet that was dropped stands before the next one; false where there is none.
    bool carry_over(std::uint32_t skipped) noexcept {
        if (stretches_.empty()) return false;
        stretches_.front().skipped += skipped;
        return true;
    }
    /// From now on they go to another number.
    void readdress() noexcept {
        for (std::size_t place = 0; place < stretches_.size(); ++place) stretches_[place].addressed = false;
    }

private:
    void begin_stretch(const shared_bytes& frame, std::uint32_t skipped, bool addressed);

    ring<stretch> stretches_;
    std::size_t packets_ = 0;
    std::size_t cost_ = 0;
};

} // namespace ise
