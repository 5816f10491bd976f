#pragma once
#include <components/seal/shore_seal.hpp>

#include <optional>

namespace atirma::seal {

/// The shore's end of a link whose key may be changed. It tells the boat of the next key and opens the boat's packets
/// under both. It seals under the next one as soon as the boat has sent a notice under it, and forgets the former one
/// when the boat sends anything else under the next.
class shore_ring {
public:
    explicit shore_ring(shore_seal now) : now_(std::move(now)) {}
    /// `recovery`: the change to `next`, sealed by the recovery key; empty: it is sealed under `now`. `uses_next`: the
    /// link was used with `next` before.
    shore_ring(shore_seal now, shore_seal next, ise::bytes recovery, bool uses_next)
        : now_(std::move(now)), next_(std::move(next)), recovery_(std::move(recovery)), uses_next_(uses_next) {}

    /// See shore_seal.
    ise::result<ise::bytes> seal(ise::bytes_view plain) { return in_use().seal(plain); }
    /// The plain packet; empty for a notice, which is about the seal only. Errors as of shore_seal::open. Afterwards,
    /// also where it fails, `take_question()` may have something for the boat.
    ise::result<ise::bytes> open(ise::bytes_view raw);
    /// The plain packet; empty for a notice, of which nothing is learnt. Errors: malformed, refused.
    ise::result<ise::bytes> read(ise::bytes_view raw) const;

    /// A sealed packet that is to be sent to the boat at once; empty: none.
    ise::bytes take_question() { return std::exchange(question_, {}); }
    /// A sealed packet that makes the boat change to the next key; empty: there is none.
    ise::bytes rekey();

    /// See shore_seal; of the key that packets to the boat are sealed under.
    bool knows_session() const noexcept { return uses_next_ ? next_->knows_session() : now_.knows_session(); }
    /// That packets to the boat are sealed under.
    const radio_key& key() const noexcept { return uses_next_ ? next_->key() : now_.key(); }
    /// To which the boat has not changed yet, as far as is known; null: none.
    const radio_key* next_key() const noexcept { return next_ ? &next_->key() : nullptr; }

private:
    shore_seal& in_use() noexcept { return uses_next_ ? *next_ : now_; }
    ise::bytes heard_under_next(shore_seal::opened came);
    bool under_next(ise::bytes_view raw) const noexcept {
        return next_ && is_sealed(raw) && epoch_of(raw) == next_->key().epoch;
    }

    static constexpr unsigned packets_between = 8; ///< of the boat, between two attempts to change its key

    shore_seal now_;
    std::optional<shore_seal> next_;
    ise::bytes recovery_, question_;
    unsigned heard_ = 0;
    bool uses_next_ = false;
};

} // namespace atirma::seal
