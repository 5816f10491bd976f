#pragma once
#include <components/seal/rekey.hpp>
#include <components/seal/sealed_frame.hpp>

#include <functional>

namespace atirma::seal {

/// What the shore keeps of a key, link and lane.
struct shore_counters {
    session of = no_session;    ///< of the boat
    std::uint64_t reserved = 1; ///< the first counter that is not reserved
    bool operator==(const shore_counters&) const = default;
};

/// The shore's end: seals packets to the boat, opens the boat's. It reserves counters on disk before it uses them: a
/// power failure skips some, and repeats none.
class shore_seal {
public:
    /// Keeps the counters, on disk when it returns.
    using store = std::function<ise::result<void>(const shore_counters&)>;
    static constexpr std::uint64_t block = 64;

    /// `kept`: what the store has kept; preset at the first start.
    shore_seal(radio_key key, seal::lane lane, shore_counters kept, store keep)
        : key_(std::move(key)), lane_(lane), kept_(kept), next_(kept.reserved), keep_(std::move(keep)) {}

    /// A plain packet, sealed under a new counter; also each repetition of it. Before the first notice of the boat it
    /// is refused there, and makes the boat send one. Errors: those of the store; refused when the 2^40 counters of the
    /// key are used up.
    ise::result<ise::bytes> seal(ise::bytes_view plain);

    /// A question for the boat's notice. Errors as of `seal`.
    ise::result<ise::bytes> ask() { return seal_frame(ask_type, {}); }
    /// Tells the boat of its next key. Errors as of `seal`.
    ise::result<ise::bytes> rekey(const radio_key& next) { return seal_frame(rekey_type, rekey_content(next)); }

    struct opened {
        ise::bytes plain;    ///< empty: it was a notice, about the seal only
        ise::bytes question; ///< to be sent at once: the shore does not know the boat's session; empty: nothing
    };
    /// Refuses what is not sealed by the boat. Errors: malformed, refused, those of the store.
    ise::result<opened> open(ise::bytes_view raw);
    /// The plain packet; empty for a notice, of which nothing is learnt. Errors: malformed, refused.
    ise::result<ise::bytes> read(ise::bytes_view raw) const;

    const radio_key& key() const noexcept { return key_; }
    /// False: no boat can open sealed packets yet.
    bool knows_session() const noexcept { return kept_.of != no_session; }

private:
    ise::result<ise::bytes> seal_frame(std::uint8_t type, ise::bytes content);
    ise::result<std::uint64_t> next();
    ise::result<void> learn(ise::bytes_view notice);

    radio_key key_;
    seal::lane lane_;
    shore_counters kept_;
    std::uint64_t next_;
    store keep_;
    bool asked_ = false;
};

} // namespace atirma::seal
