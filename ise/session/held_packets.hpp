#pragma once
#include <ise/session/carried_packet.hpp>

#include <cstddef>
#include <deque>
#include <utility>

namespace ise {

/// The bytes that held packets may take: of one session in one direction, or of one subscriber. Outlives its
/// `held_packets`.
struct held_budget {
    std::size_t most;
    std::size_t used = 0;
    std::size_t packets = 0; ///< held; those without bytes count too

    /// Whether there is room for a packet of so many bytes. There is for a lone one, however large.
    bool fits(std::size_t size) const noexcept { return packets == 0 || used + size <= most; }
    void take(std::size_t size) noexcept {
        used += size;
        ++packets;
    }
    void give_back(std::size_t size) noexcept {
        used -= size;
        --packets;
    }
};

/// Packets that came before it is known whether both sides' schemas of their service fit: held in their order, each
/// with what its receiver has to remember (`Head`), and bounded in number and bytes.
template <class Head>
class held_packets {
public:
    /// At most so many, within a budget that others share.
    held_packets(std::size_t most, held_budget& budget) : most_(most), budget_(budget) {}
    held_packets(const held_packets&) = delete;
    held_packets& operator=(const held_packets&) = delete;
    ~held_packets() { clear(); }

    std::size_t size() const noexcept { return all_.size(); }
    /// False, and it is not held, where there is no room for it.
    bool hold(const Head& head, incoming_packet& packet) {
        const auto size = packet.size();
        if (all_.size() >= most_ || !budget_.fits(size)) return false;
        all_.push_back({head, packet.keep()});
        budget_.take(size);
        return true;
    }
    /// Gives each to `take(head, packet)`, in their order; what `take` lets come meanwhile is not held here.
    template <class Take>
    void release(Take take) {
        auto all = std::exchange(all_, {});
        for (const auto& one : all) budget_.give_back(one.packet.size());
        for (auto& one : all) take(one.head, incoming_packet(one.packet));
    }
    void drop_oldest() noexcept {
        budget_.give_back(all_.front().packet.size());
        all_.pop_front();
    }
    /// Drops those whose head it is.
    template <class Is>
    void drop(Is is) {
        std::erase_if(all_, [&](const held& one) {
            if (!is(one.head)) return false;
            budget_.give_back(one.packet.size());
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
    held_budget& budget_;
    std::deque<held> all_;
};

} // namespace ise
