#pragma once
#include <components/seal/boat_notice.hpp>
#include <components/seal/sealed_frame.hpp>

#include <functional>
#include <optional>
#include <utility>

namespace atirma::seal {

/// The session of the boat, and the counters that it has accepted in it, of each lane.
struct boat_counters {
    static constexpr std::uint64_t window = 64; ///< packets may overtake each other by so many

    struct of_lane {
        std::uint64_t highest = 0; ///< 0: none; counters begin at 1
        std::uint64_t seen = 0;    ///< bit i: highest - i was accepted
        bool operator==(const of_lane&) const = default;
    };
    session of = no_session;
    std::array<of_lane, 2> lanes{};
    bool operator==(const boat_counters&) const = default;
};

/// The boat's end: seals its packets, opens those of the shore. It keeps the counter of a packet before it hands the
/// packet out; if that fails it hands nothing out. So no packet is executed twice, whenever the power fails.
class boat_seal {
public:
    /// Keeps the counters, on disk when it returns.
    using store = std::function<ise::result<void>(const boat_counters&)>;

    /// `kept`: what the store has kept for this key. Nothing: the memory is lost or new, and a session begins with
    /// `random`, which was never used before: whatever was sealed before it is refused.
    boat_seal(radio_key key, std::optional<boat_counters> kept, std::uint64_t random, store keep);

    /// The plain packet with its checksum; empty for a question about the seal. Refuses what is not sealed for this
    /// session, and repeated packets. Errors: malformed, refused, those of the store.
    ise::result<ise::bytes> open(ise::bytes_view raw);

    /// A plain packet of the boat, sealed.
    ise::bytes seal(ise::bytes_view plain) const { return seal_from_boat(key_, plain); }

    /// Sealed; to be sent whenever `take_notice_due()` says so.
    ise::bytes notice() const;
    /// Whether a session has begun, or a sealed packet of this key epoch was refused or asked, since the last call.
    bool take_notice_due() noexcept { return std::exchange(notice_due_, false); }
    bool notice_due() const noexcept { return notice_due_; }
    /// A notice is due.
    void ask() noexcept { notice_due_ = true; }

    const radio_key& key() const noexcept { return key_; }
    const boat_counters& counters() const noexcept { return counters_; }

private:
    radio_key key_;
    boat_counters counters_;
    store keep_;
    bool notice_due_ = false;
};

} // namespace atirma::seal
