#pragma once
#include <components/seal/boat_seal.hpp>
#include <components/seal/rekey.hpp>

#include <functional>
#include <optional>
#include <vector>

namespace atirma::seal {

/// The keys that the boat stores.
struct boat_keys {
    radio_key now;                 ///< of no link
    std::optional<radio_key> next; ///< accepted, and not used yet: then it takes the place of `now`
    bool next_by_recovery = false; ///< `now` cannot replace it: it may be in wrong hands
    std::uint64_t recovered = 0;   ///< highest generation of a change by the recovery key
};

/// The boat's ends of all its links, whose key may be changed over any of them: it accepts both keys until the first
/// packet under the new one. What it learns of keys is kept before it counts.
class boat_ring {
public:
    /// Keeps the keys, on disk when it returns.
    using key_store = std::function<ise::result<void>(const boat_keys&)>;
    /// Makes the end of a link with that key, which names the link. The notice of an end whose memory is new holds also
    /// after a restart.
    using end_maker = std::function<ise::result<boat_seal>(const radio_key&)>;

    /// `recovery`: opens changes of the key only; nothing: there is none. Errors: those of `make`.
    static ise::result<boat_ring> make(boat_keys keys, std::optional<radio_key> recovery,
                                       std::vector<std::string> links, end_maker make, key_store keep);

    /// See boat_seal. Empty: the packet was about the seal. `link`: its place in `links`.
    ise::result<ise::bytes> open(std::size_t link, ise::bytes_view raw);
    /// Under the key in use.
    ise::bytes seal(std::size_t link, ise::bytes_view plain) const { return now_[link].seal(plain); }
    bool notice_due(std::size_t link) const;
    /// Sealed under the key that it is about; empty: none is due.
    ise::bytes take_notice(std::size_t link);

    const boat_keys& keys() const noexcept { return keys_; }

private:
    boat_ring(boat_keys keys, std::optional<radio_key> recovery, std::vector<std::string> links, end_maker make,
              key_store keep)
        : keys_(std::move(keys)), recovery_(std::move(recovery)), links_(std::move(links)), make_(std::move(make)),
          keep_(std::move(keep)) {}

    ise::result<std::vector<boat_seal>> ends_of(const radio_key& key) const;
    ise::result<void> recover(std::size_t link, const recovered_key& outcome);
    ise::result<void> accept(std::size_t link, const radio_key& outcome, boat_keys then);
    ise::result<void> promote();
    void answer(std::size_t link);

    boat_keys keys_;
    std::optional<radio_key> recovery_;
    std::vector<std::string> links_;
    end_maker make_;
    key_store keep_;
    std::vector<boat_seal> now_, next_; // by link; `next_` is empty without a next key
    bool next_spoke_ = false;           // both have their turn
};

} // namespace atirma::seal
