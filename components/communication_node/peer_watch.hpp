#pragma once
#include <ise/core/time.hpp>

#include <algorithm>
#include <cstdint>

namespace atirma {

/// What is known of the other node: whether it lives, and what of ours is on its disk. Decides from when on a packet
/// counts as kept and may be told: when it is on both disks, or the other node is silent. Without I/O.
class peer_watch {
public:
    /// Without a peer nobody is waited for. One that was never heard is waited for until the silence is over.
    peer_watch(bool has_peer, ise::duration silence, ise::time_point now)
        : has_peer_(has_peer), silence_(silence), heard_(now) {}

    /// It asked for more, and so tells what it has: positions of this node's present store, none above its head.
    void on_request(ise::time_point now, bool keeps, std::uint64_t packets, std::uint64_t commands, std::uint32_t epoch,
                    std::uint64_t change) {
        heard_ = now;
        keeps_ = keeps;
        packets_ = packets;
        commands_ = commands;
        epoch_ = epoch;
        change_ = change;
    }

    /// The store of this node is a new one: nothing of it is at the other node yet.
    void forget() noexcept {
        packets_ = commands_ = change_ = 0;
        epoch_ = 0;
    }

    bool silent(ise::time_point now) const noexcept { return !has_peer_ || now - heard_ >= silence_; }
    /// It is there, and its disk takes what it is told.
    bool lives(ise::time_point now) const noexcept { return has_peer_ && keeps_ && now - heard_ < silence_; }
    /// When it counts as silent unless it is heard.
    ise::time_point silent_at() const noexcept {
        return has_peer_ ? ise::saturating_add(heard_, silence_) : ise::time_point::min();
    }

    bool has_packets(std::uint64_t position) const noexcept { return packets_ >= position; }
    bool has_commands(std::uint64_t position) const noexcept { return commands_ >= position; }
    bool has_authority(std::uint32_t epoch, std::uint64_t change) const noexcept {
        return epoch_ > epoch || (epoch_ == epoch && change_ >= change);
    }
    /// How many of `head` packets it does not have.
    std::uint64_t misses(std::uint64_t head) const noexcept { return has_peer_ ? head - std::min(head, packets_) : 0; }
    /// Up to where packets may be told, of `head` that are on this disk.
    std::uint64_t shown(std::uint64_t head, ise::time_point now) const noexcept {
        return lives(now) ? std::min(head, packets_) : head;
    }

private:
    bool has_peer_;
    ise::duration silence_;
    ise::time_point heard_;
    bool keeps_ = true;
    std::uint64_t packets_ = 0, commands_ = 0, change_ = 0;
    std::uint32_t epoch_ = 0;
};

} // namespace atirma
