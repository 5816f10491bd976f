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
};

/// Packets that came before it is known whether both sides' schemas of their service fit: held in their order, each
/// with what its receiver has to remember (`Head`), and bounded in number and bytes.
template <class Head>
class held_packets {
public:
    /// At most so many, within a budget that others share.
    held_packets(std::size_t most, held_budget& budget) noexcept : most_(most), budget_(budget) {}
    held_packets(const held_packets&) = delete;
    held_packets& operator=(const held_packets&) = delete;
    ~held_packets() { clear(); }

    std::size_t size() const noexcept { return all_.size(); }
    /// False, and it is not held, where there is no room for it. There is for a lone one, however large.
    bool hold(const Head& head, incoming_packet& packet) {
        const auto size = packet.size();
        if (all_.size() >= most_ || (budget_.packets > 0 && budget_.used + size > budget_.most)) return false;
        all_.push_back({head, packet.keep()});
        budget_.used += size;
        ++budget_.packets;
        return true;
    }
    /// Gives each to `take(head, packet)`, in their order; what `take` lets come meanwhile is not held here.
    template <class Take>
    void release(Take take) {
        auto all = std::exchange(all_, {});
        for (const auto& one : all) give_back(one);
        for (auto& one : all) take(one.head, incoming_packet(one.packet));
    }
    void drop_oldest() noexcept {
        give_back(all_.front());
        all_.pop_front();
    }
    /// Drops those whose head it is.
    template <class Is>
    void drop(Is is) {
        std::erase_if(all_, [&](const held& one) {
            if (!is(one.head)) return false;
            give_back(one);
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
    void give_back(const held& one) noexcept {
        budget_.used -= one.packet.size();
        --budget_.packets;
    }
    std::size_t most_;
    held_budget& budget_;
    std::deque<held> all_;
};

} // namespace ise
