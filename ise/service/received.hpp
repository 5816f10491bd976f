#pragma once
#include <ise/service/subscriber_core.hpp>

#include <cstdint>
#include <deque>
#include <memory>
#include <utility>

namespace ise {

/// A published packet as a subscriber holds it: points to a const packet, shared, never copied. Empty once the
/// subscription has ended.
template <class Packet>
class received {
public:
    received() = default;
    received(std::shared_ptr<const Packet> packet, std::uint64_t lost_before) : packet_(std::move(packet)), lost_before_(lost_before) {}

    explicit operator bool() const noexcept { return packet_ != nullptr; }
    const Packet& operator*() const noexcept { return *packet_; }
    const Packet* operator->() const noexcept { return packet_.get(); }
    const std::shared_ptr<const Packet>& share() const noexcept { return packet_; }

    /// Packets that were published since the one before and did not arrive; `unknown_gap` after a restart.
    std::uint64_t lost_before() const noexcept { return lost_before_; }

private:
    std::shared_ptr<const Packet> packet_;
    std::uint64_t lost_before_ = 0;
};

/// The packets of a subscription that nobody has taken yet.
template <class Packet>
class received_queue {
public:
    bool empty() const noexcept { return packets_.empty(); }
    std::size_t size() const noexcept { return packets_.size(); }
    void push(std::shared_ptr<const Packet> packet, std::uint64_t lost_before) { packets_.emplace_back(std::move(packet), lost_before); }

    /// The oldest, or an empty one.
    received<Packet> take() {
        if (packets_.empty()) return {};
        auto first = std::move(packets_.front());
        packets_.pop_front();
        return first;
    }

    /// Drops the oldest; the next one tells of the gap. What nobody is there to tell is returned.
    std::uint64_t drop_oldest() {
        auto gap = gap_of(packets_.front().lost_before(), 1);
        packets_.pop_front();
        if (packets_.empty()) return gap;
        packets_.front() = received<Packet>(packets_.front().share(), gap_of(gap, packets_.front().lost_before()));
        return 0;
    }

private:
    std::deque<received<Packet>> packets_;
};

} // namespace ise
