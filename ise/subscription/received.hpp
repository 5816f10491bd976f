#pragma once
#include <ise/core/counted.hpp>
#include <ise/core/time.hpp>

#include <cstdint>
#include <memory>
#include <optional>
#include <utility>

namespace ise {

namespace detail {

// The length of a gap that nobody knows: the provider restarted, or did not know the subscriber any more.
inline constexpr std::uint64_t unknown_gap = ~std::uint64_t{0};

// Of a packet without a time of publication.
inline constexpr wall_time no_stamp = wall_time::min();

} // namespace detail

/// Metadata of a received packet.
struct packet_origin {
    std::uint64_t lost_before = 0;             ///< or `detail::unknown_gap`
    wall_time published_at = detail::no_stamp; ///< or `detail::no_stamp`
};

/// A published packet as a subscriber receives it: points to a const packet that is shared and never copied; it may be
/// kept for any time and on any thread. If the publisher is in the same process, it is the packet that was published
/// there. Empty once the subscription has ended.
template <class Packet>
class received {
public:
    received() = default;
    /// Made by the subscription.
    received(counted<Packet> packet, const packet_origin& from) noexcept : packet_(std::move(packet)), from_(from) {}

    /// Whether there is a packet.
    explicit operator bool() const noexcept { return static_cast<bool>(packet_); }
    /// The packet; only where there is one.
    const Packet& operator*() const noexcept { return *packet_; }
    /// As above.
    const Packet* operator->() const noexcept { return packet_.get(); }
    /// The packet as a shared_ptr.
    std::shared_ptr<const Packet> share() const {
        if (!packet_) return nullptr;
        return {std::make_shared<counted<Packet>>(packet_), packet_.get()};
    }

    /// Returns the packet by value and leaves this object empty: moved if there is no other holder, else copied.
    /// Requires a packet.
    Packet take() {
        auto held = std::exchange(packet_, {});
        if (held.alone()) return std::move(*held);
        return *held;
    }

    /// The number of packets lost between the previous packet and this one. Empty if it is unknown, after a restart of
    /// the provider.
    std::optional<std::uint64_t> lost_before() const noexcept {
        if (from_.lost_before == detail::unknown_gap) return std::nullopt;
        return from_.lost_before;
    }

    /// When it was published, by the wall clock of the provider's host: the time of the first packet that the provider
    /// published in the same loop iteration. Empty if the provider's version does not send it.
    std::optional<wall_time> published_at() const noexcept {
        if (from_.published_at == detail::no_stamp) return std::nullopt;
        return from_.published_at;
    }
    /// Both, as the subscription has them.
    const packet_origin& origin() const noexcept { return from_; }

private:
    counted<Packet> packet_;
    packet_origin from_;
};

} // namespace ise
