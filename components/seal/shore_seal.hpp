#pragma once
#include <components/seal/sealed_frame.hpp>

#include <functional>

namespace atirma::seal {

/// Reserves counters on disk before it uses them: a power failure skips some, and repeats none.
class counter_source {
public:
    /// Keeps the first counter that is not reserved, on disk when it returns.
    using store = std::function<ise::result<void>(std::uint64_t)>;
    static constexpr std::uint64_t block = 64;

    /// `kept`: what the store has kept; 1 at the first start.
    counter_source(std::uint64_t kept, store keep) : next_(kept), reserved_(kept), keep_(std::move(keep)) {}

    /// Errors: those of the store; refused when the 2^40 counters of the key are used up.
    ise::result<std::uint64_t> next();
    /// The boat has seen that one already: continues above it, e.g. after the store was lost.
    void skip(std::uint64_t seen) noexcept;

private:
    std::uint64_t next_, reserved_;
    store keep_;
};

/// The shore's end: seals packets to the boat, opens the boat's.
class shore_seal {
public:
    shore_seal(radio_key key, seal::lane lane, std::uint64_t kept, counter_source::store keep)
        : key_(std::move(key)), lane_(lane), counters_(kept, std::move(keep)) {}

    /// A plain packet, sealed under a new counter; also each repetition of it. Errors: those of counter_source.
    ise::result<ise::bytes> seal(ise::bytes_view plain);

    struct opened {
        ise::bytes plain;  ///< empty: it was a notice, about the seal only
        ise::bytes resync; ///< to be sent at once; empty: nothing
    };
    /// Refuses what is not sealed by the boat. Errors: malformed, refused, those of counter_source.
    ise::result<opened> open(ise::bytes_view raw);

    const radio_key& key() const noexcept { return key_; }

private:
    radio_key key_;
    seal::lane lane_;
    counter_source counters_;
};

} // namespace atirma::seal
