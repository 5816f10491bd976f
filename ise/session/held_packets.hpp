#pragma once
#include <ise/core/limits.hpp>
#include <ise/session/carried_packet.hpp>

#include <cstddef>
#include <deque>
#include <utility>

namespace ise {

/// Packets that came before it is known whether both sides' schemas of their service fit: held in their order, each with
/// what its receiver has to remember (`Head`), and bounded in number and bytes.
template <class Head>
class held_packets {
public:
    /// `bytes`: what all that share it hold, up to `limit::held_bytes`; outlives this.
    held_packets(std::size_t most, std::size_t& bytes) noexcept : most_(most), bytes_(bytes) {}
    held_packets(const held_packets&) = delete;
    held_packets& operator=(const held_packets&) = delete;
    ~held_packets() { clear(); }

    std::size_t size() const noexcept { return all_.size(); }
    /// False, and it is not held, where there is no room for it.
    bool hold(const Head& head, incoming_packet& packet) {
        const auto size = packet.size();
        if (all_.size() >= most_ || bytes_ + size > limit::held_bytes) return false;
        all_.push_back({head, packet.keep()});
        bytes_ += size;
        return true;
    }
    /// Gives each to `take(head, packet)`, in their order; what `take` lets come meanwhile is not held here.
    template <class Take>
    void release(Take take) {
        auto all = std::exchange(all_, {});
        for (auto& one : all) bytes_ -= one.packet.size();
        for (auto& one : all) take(one.head, incoming_packet(one.packet));
    }
    void drop_oldest() noexcept {
        bytes_ -= all_.front().packet.size();
        all_.pop_front();
    }
    /// Drops those whose head it is.
    template <class Is>
    void drop(Is is) {
        std::erase_if(all_, [&](const held& one) {
            if (!is(one.head)) return false;
            bytes_ -= one.packet.size();
            return true;
        });
    }
    void clear() noexcept {
        while (!all_.empty()) drop_oldest();
    }

private:
    struct held {
        Head head;
        payload packet;
    };
    std::size_t most_;
    std::size_t& bytes_;
    std::deque<held> all_;
};

} // namespace ise
