#include <components/seal/boat_ring.hpp>

#include <components/boat/layout.hpp>

#include <utility>

namespace atirma::seal {
namespace {

bool same(const radio_key& a, const radio_key& b) { return a.epoch == b.epoch && a.secret == b.secret; }

// Of a packet of `rekey_type` that boat_seal opened: between type and checksum.
ise::bytes_view content_of(ise::bytes_view plain) { return plain.subspan(2, plain.size() - 2 - layout::checksum_size); }
bool is_rekey(ise::bytes_view plain) { return plain.size() > 1 && plain[1] == static_cast<std::byte>(rekey_type); }

} // namespace

ise::result<boat_ring> boat_ring::make(boat_keys keys, std::optional<radio_key> recovery,
                                       std::vector<std::string> links, end_maker make, key_store keep) {
    boat_ring made(std::move(keys), std::move(recovery), std::move(links), std::move(make), std::move(keep));
    auto now = made.ends_of(made.keys_.now);
    if (!now) return now.error();
    made.now_ = std::move(*now);
    if (!made.keys_.next) return made;
    auto next = made.ends_of(*made.keys_.next);
    if (!next) return next.error();
    made.next_ = std::move(*next);
    return made;
}

ise::result<std::vector<boat_seal>> boat_ring::ends_of(const radio_key& key) const {
    std::vector<boat_seal> made;
    for (const auto& link : links_) {
        auto mine = key;
        mine.link = link;
        auto end = make_(mine);
        if (!end) return end.error();
        made.push_back(std::move(*end));
    }
    return made;
}

ise::result<ise::bytes> boat_ring::open(std::size_t link, ise::bytes_view raw) {
    if (recovery_ && is_rekey(raw)) {
        if (auto outcome = open_recovery(*recovery_, raw)) {
            if (auto done = recover(link, *outcome); !done) return done.error();
            return ise::bytes();
        }
    }
    bool by_next = !next_.empty() && is_sealed(raw) && epoch_of(raw) == keys_.next->epoch;
    auto opened = by_next ? next_[link].open(raw) : now_[link].open(raw);
    // A change by the recovery key may have the epoch of the key that somebody else has put in its place.
    if (by_next && !opened && keys_.now.epoch == keys_.next->epoch) {
        by_next = false;
        opened = now_[link].open(raw);
    }
    if (!opened) return opened.error();
    if (by_next) {
        if (auto done = promote(); !done) return done.error();
    } else if (!next_.empty()) {
        next_[link].ask(); // the shore has not heard yet that the next key may be used
    }
    if (!is_rekey(*opened)) return opened;
    auto next = parse_rekey(content_of(*opened), keys_.now);
    if (!next) return next.error();
    if (keys_.next_by_recovery)
        return ise::failure(ise::errc::refused,
                            "the recovery key has changed the key: the former one does not change it again");
    if (auto done = accept(link, *next, keys_); !done) return done.error();
    return ise::bytes();
}

ise::result<void> boat_ring::recover(std::size_t link, const recovered_key& outcome) {
    if (outcome.generation <= keys_.recovered) {
        answer(link);
        return ise::failure(ise::errc::refused, "a change by the recovery key was repeated, or is too old");
    }
    auto then = keys_;
    then.recovered = outcome.generation;
    then.next_by_recovery = true;
    return accept(link, outcome.next, std::move(then));
}

ise::result<void> boat_ring::accept(std::size_t link, const radio_key& outcome, boat_keys then) {
    bool in_use = same(outcome, keys_.now), known = keys_.next && same(outcome, *keys_.next);
    if (in_use) {
        then.next.reset();
        then.next_by_recovery = false;
    } else {
        then.next = outcome;
    }
    bool changes = then.recovered != keys_.recovered || then.next_by_recovery != keys_.next_by_recovery ||
                   then.next.has_value() != keys_.next.has_value() || (!in_use && !known);
    if (changes) {
        std::vector<boat_seal> ends;
        if (!in_use && !known) {
            auto made = ends_of(outcome);
            if (!made) return made.error();
            ends = std::move(*made);
        }
        if (auto kept = keep_(then); !kept) return kept.error();
        keys_ = std::move(then);
        if (in_use || !known) next_ = std::move(ends);
    }
    answer(link);
    return {};
}

ise::result<void> boat_ring::promote() {
    auto then = keys_;
    then.now = std::move(*then.next);
    then.next.reset();
    then.next_by_recovery = false;
    if (auto kept = keep_(then); !kept) return kept.error();
    keys_ = std::move(then);
    now_ = std::exchange(next_, {});
    return {};
}

void boat_ring::answer(std::size_t link) { (next_.empty() ? now_ : next_)[link].ask(); }

bool boat_ring::notice_due(std::size_t link) const {
    return now_[link].notice_due() || (!next_.empty() && next_[link].notice_due());
}

ise::bytes boat_ring::take_notice(std::size_t link) {
    bool next = !next_.empty() && next_[link].notice_due() && !(next_spoke_ && now_[link].notice_due());
    next_spoke_ = next;
    auto& of = next ? next_[link] : now_[link];
    return of.take_notice_due() ? of.notice() : ise::bytes();
}

} // namespace atirma::seal
