#pragma once
#include <components/communication_node/services.hpp>

#include <algorithm>
#include <cstdint>
#include <deque>
#include <span>
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
    /// The part of it that is certainly still here, by the number of this life: nothing of an unknown life, and of one
    /// that went on elsewhere only the rows from before the store was set back.
    store_part shared(const store_part& known) const {
        store_part made;
        made.store = now.store;
        const auto* life = find(known.store);
        if (!life) return made;
        bool beyond = known.packets > life->packets || known.commands > life->commands;
        if (life == &now && beyond) return made; // the store went back in time
        made.packets = std::min(known.packets, life->packets);
        made.commands = std::min(known.commands, life->commands);
        return made;
    }
    /// The same by the one of several lives by which most is certain.
    store_part shared(std::span<const store_part> known) const {
        store_part best;
        for (const auto& one : known) {
            auto part = shared(one);
            if (part.packets > best.packets || (part.packets == best.packets && part.commands > best.commands))
                best = part;
        }
        return best;
    }
    /// Of packets, the position up to which a follower with that cursor knows this store.
    std::uint64_t known_by(const track_cursor& seen) const {
        std::uint64_t made = 0;
        for (const auto& [store, position] : seen) {
            store_part known;
            known.store = store;
            known.packets = position;
            made = std::max(made, shared(known).packets);
        }
        return made;
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
