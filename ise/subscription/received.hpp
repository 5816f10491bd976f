#pragma once
#include <ise/core/counted.hpp>

#include <cstdint>
#include <memory>
#include <optional>
#include <utility>

namespace ise {

namespace detail {

// The length of a gap that nobody knows: the provider restarted, or did not know the subscriber any more.
inline constexpr std::uint64_t unknown_gap = ~std::uint64_t{0};

} // namespace detail

/// A published packet as a subscriber receives it: points to a const packet that is shared and never copied; it may be
/// kept for any time and on any thread. If the publisher is in the same process, it is the packet that was published
/// there. Empty once the subscription has ended.
template <class Packet>
class received {
public:
    received() = default;
    /// Made by the subscription.
    received(counted<Packet> packet, std::uint64_t lost_before) noexcept
        : packet_(std::move(packet)), lost_before_(lost_before) {}

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
        if (lost_before_ == detail::unknown_gap) return std::nullopt;
        return lost_before_;
    }

private:
    counted<Packet> packet_;
    std::uint64_t lost_before_ = 0;
};

/// Where packets are decoded: into one that nobody holds any more, with the memory that it has, or a new one.
template <class Packet>
class received_cells {
public:
    counted<Packet>& unheld() { ///< for the next packet
        if (cells_[0] && cells_[0].alone()) return cells_[0];
        std::swap(cells_[0], cells_[1]); // who assigns the next packet to the last one holds two
        if (!cells_[0] || !cells_[0].alone()) cells_[0] = counted<Packet>::make();
        return cells_[0];
    }

private:
    counted<Packet> cells_[2];
};

} // namespace ise
