#pragma once
#include <components/seal/boat_notice.hpp>
#include <components/seal/sealed_frame.hpp>

#include <functional>
#include <optional>
#include <utility>

namespace atirma::seal {

/// The counters that the boat has accepted, of each lane.
struct boat_counters {
    static constexpr std::uint64_t window = 64; ///< packets may overtake each other by so many

    struct of_lane {
        bool known = false;
        std::uint64_t highest = 0;
        std::uint64_t seen = 0; ///< bit i: highest - i was accepted
        bool operator==(const of_lane&) const = default;
    };
    std::array<of_lane, 2> lanes{};
    bool operator==(const boat_counters&) const = default;
};

/// The boat's end: seals its packets, opens those of the shore. It keeps the counter of a packet before it hands the
/// packet out; if that fails it hands nothing out. So no packet is executed twice, whenever the power fails.
class boat_seal {
public:
    /// Keeps the counters, on disk when it returns.
    using store = std::function<ise::result<void>(const boat_counters&)>;

    /// `kept`: what the store has kept for this key. Nothing: the memory is lost or new, and each lane needs a resync
    /// over `challenge`, which is random and new at each start.
    boat_seal(radio_key key, std::optional<boat_counters> kept, std::uint64_t challenge, store keep)
        : key_(std::move(key)), counters_(kept.value_or(boat_counters())), challenge_(challenge),
          keep_(std::move(keep)) {}

    /// The plain packet with its checksum; empty after a resync. Refuses what is not sealed, repeated packets, and,
    /// before a resync, all others. Errors: malformed, refused, those of the store.
    ise::result<ise::bytes> open(ise::bytes_view raw);

    /// A plain packet of the boat, sealed.
    ise::bytes seal(ise::bytes_view plain) const { return seal_from_boat(key_, plain); }

    /// Sealed; to be sent after the start and whenever `take_notice_due()` says so.
    ise::bytes notice() const;
    /// Whether a packet with a good tag was refused for its counter since the last call.
    bool take_notice_due() noexcept { return std::exchange(notice_due_, false); }

    const radio_key& key() const noexcept { return key_; }
    const boat_counters& counters() const noexcept { return counters_; }

private:
    radio_key key_;
    boat_counters counters_;
    std::uint64_t challenge_;
    store keep_;
    bool notice_due_ = false;
};

} // namespace atirma::seal
