#pragma once
#include <components/communication_node/services.hpp>

#include <algorithm>
#include <cstdint>
#include <deque>
#include <vector>

namespace atirma {

/// How far a store is known, by the number of its present life, and how far its earlier lives came. Without I/O.
struct store_lives {
    static constexpr std::size_t most = 1000; ///< a follower that was away for more lives starts from the beginning

    store_part now;
    std::deque<store_part> over; ///< the newest first

    /// What the numbers of that life mean; null: it is unknown.
    const store_part* find(std::uint64_t number) const {
        if (number == 0) return nullptr;
        if (number == now.store) return &now;
        auto at = std::ranges::find(over, number, &store_part::store);
        return at == over.end() ? nullptr : &*at;
    }
    /// Begins another life, which continues at the same positions.
    void begin(std::uint64_t number) {
        if (now.store != 0) over.push_front(now);
        if (over.size() > most) over.pop_back();
        now.store = number;
    }
    /// Nothing beyond that is known any more.
    void cut(std::uint64_t packets, std::uint64_t commands) {
        auto shorten = [&](store_part& life) {
            life.packets = std::min(life.packets, packets);
            life.commands = std::min(life.commands, commands);
        };
        shorten(now);
        std::ranges::for_each(over, shorten);
    }
};

} // namespace atirma
