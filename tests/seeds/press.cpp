#include "press.hpp"

namespace seeds {

std::uint64_t press::opened(const std::string& by) {
    auto life = ++last_;
    all_[life].by = by;
    by_component_[by].insert(life);
    return life;
}

std::uint64_t press::current(const std::string& by) const {
    std::uint64_t only = 0;
    auto found = by_component_.find(by);
    if (found == by_component_.end()) return 0;
    for (auto life : found->second) {
        if (!all_.at(life).open) continue;
        if (only) return 0;
        only = life;
    }
    return only;
}

reading::reading(journal& events, ise::sim::world& world, const press& published, sabotage& planted, std::string who,
                 std::string provider, const ise::subscribe_options& terms, ise::duration linger,
                 const std::map<std::string, std::set<std::string>>& rivalled)
    : journal_(events), world_(world), press_(published), planted_(planted), who_(std::move(who)),
      provider_(std::move(provider)), terms_(terms), linger_(linger), rivalled_(rivalled),
      life_at_begin_(press_.current(provider_)),
      published_at_begin_(life_at_begin_ ? press_.at(life_at_begin_).published : 0) {}

void reading::committed() {
    life_at_commit_ = press_.current(provider_);
    if (life_at_commit_) published_at_commit_ = press_.at(life_at_commit_).published;
    journal_.note("{} is subscribed to {}, which has published {} packets of life {}", who_, provider_,
                  published_at_commit_, life_at_commit_);
    journal_.tally("subscriptions");
}

void reading::packet(const beat& got, std::optional<std::uint64_t> lost_before,
                     const ise::subscription_counts& counts) {
    auto number = got.number;
    if (number_ != 0 && planted_.strikes(bug::packet_lost)) return;
    if (number_ != 0 && planted_.strikes(bug::packets_swapped)) {
        held_number_ = number;
        return;
    }
    if (lost_before != 0 && planted_.strikes_once(bug::gap_forgotten)) lost_before = 0;
    journal_.note("{} has packet {} of life {} from {}, {} lost before", who_, number, got.life, provider_,
                  lost_before ? std::to_string(*lost_before) : "unknown");
    journal_.tally("packets received");
    if (sum_of(got.content) != got.check)
        journal_.broken("{}: packet {} of life {} has other content", who_, number, got.life);
    if (!press_.knows(got.life) || number > press_.at(got.life).began)
        return journal_.broken("{}: packet {} of life {} was not published", who_, number, got.life);
    if (number <= newest_[got.life])
        journal_.broken("{}: packet {} of life {} came after packet {}", who_, number, got.life, newest_[got.life]);
    newest_[got.life] = number;

    if (life_ == 0) {
        check_first(got.life, number, lost_before, counts);
    } else if (got.life == life_ && lost_before) {
        check_next(number, *lost_before, counts);
    } else {
        note_life(got.life, lost_before);
    }
    if (!lost_before) {
        ++unknown_gaps_;
        journal_.tally("gaps of unknown length");
    } else if (*lost_before > 0) {
        all_lost_ += *lost_before;
        journal_.tally("gaps that were counted");
    }
    if (unknown_gaps_ > counts.restarts)
        journal_.broken("{}: {} gaps of unknown length, and {} restarts are counted", who_, unknown_gaps_,
                        counts.restarts);
    if (all_lost_ > counts.lost_at_provider + counts.lost_here + counts.undecodable)
        journal_.broken("{}: the gaps tell of {} packets, the counts of {} and {}", who_, all_lost_,
                        counts.lost_at_provider, counts.lost_here);
    if (counts.undecodable > 0) journal_.broken("{}: {} packets were undecodable", who_, counts.undecodable);
    if (terms_.policy == ise::overflow::lossless && all_lost_ + unknown_gaps_ > 0)
        journal_.broken("{}: a lossless subscription went on with {} packets lost, and {} gaps of unknown length", who_,
                        all_lost_, unknown_gaps_);
    if (counts.resumed > resumed_) {
        journal_.tally("subscriptions resumed", counts.resumed - resumed_);
        resumed_ = counts.resumed;
    }
    ++received_;
    ++all_received_;
    if (all_received_ > counts.received)
        journal_.broken("{}: took {} packets, and {} are counted", who_, all_received_, counts.received);
    life_ = got.life;
    number_ = number;
    if (auto held = std::exchange(held_number_, 0); held || planted_.strikes(bug::packet_twice)) {
        beat again = got;
        if (held) again.number = held;
        packet(again, 0, counts);
    }
}

void reading::check_first(std::uint64_t life, std::uint64_t number, std::optional<std::uint64_t> lost_before,
                          const ise::subscription_counts& counts) {
    if (!lost_before) {
        if (counts.restarts == 0)
            journal_.broken("{}: its first packet tells of an unknown gap, and nothing was restarted", who_);
        first_ = number;
        return;
    }
    if (*lost_before >= number)
        return journal_.broken("{}: {} packets were lost before packet {}", who_, *lost_before, number);
    first_ = number - *lost_before;
    lost_ = *lost_before;
    if (life == life_at_begin_ && !limited() && counts.restarts == 0) {
        auto least = published_at_begin_ + (terms_.last_value ? 0 : 1);
        if (first_ < least)
            journal_.broken("{}: begins with packet {}, which is older than packet {} when it subscribed", who_, first_,
                            least);
    }
    if (life == life_at_commit_ && !limited() && counts.restarts == 0 && first_ > published_at_commit_ + 1)
        journal_.broken(
            "{}: begins with packet {}, and {} had been published when it was subscribed: the others are missing", who_,
            first_, published_at_commit_);
}

void reading::check_next(std::uint64_t number, std::uint64_t lost_before, const ise::subscription_counts&) {
    if (number <= number_) return; // told already
    auto missing = number - number_ - 1;
    lost_ += lost_before;
    if (limited() ? lost_before > missing : lost_before != missing)
        journal_.broken("{}: {} packets are missing between {} and {} of life {}, and the gap says {}", who_, missing,
                        number_, number, life_, lost_before);
}

// Another life of the publication, or the same one that did not know the subscriber any more.
void reading::note_life(std::uint64_t life, std::optional<std::uint64_t> lost_before) {
    if (lost_before)
        journal_.broken("{}: life {} follows on life {}, and the gap says {} packets", who_, life, life_, *lost_before);
    if (!rivalled_.contains(provider_) && life < life_)
        journal_.broken("{}: life {} of {} follows on life {}: time goes backwards", who_, life, provider_, life_);
    bool kept = terms_.policy == ise::overflow::keep_last || terms_.policy == ise::overflow::keep_latest;
    auto since = world_.now() - press_.at(life_).at[number_ - 1]; // the subscriber was known when that was published
    if (life == life_ && kept && since < linger_)
        journal_.broken("{}: an unknown gap within life {}, {:.3f} s after a packet was published, and the provider "
                        "keeps subscribers for {:.0f} s",
                        who_, life, std::chrono::duration<double>(since).count(),
                        std::chrono::duration<double>(linger_).count());
    first_ = 0;
    received_ = lost_ = 0;
}

void reading::ended(const ise::failure& why, const ise::subscription_counts&) {
    journal_.note("{}: its subscription to {} ended: {} {}", who_, provider_, ise::name_of(why.code()), why.message());
    journal_.tally(fmt::format("subscriptions that ended as {}", ise::name_of(why.code())));
    using ise::errc;
    switch (why.code()) {
        case errc::cancelled:
        case errc::peer_lost:
        case errc::no_such_service: return;
        case errc::overloaded:
            if (terms_.policy == ise::overflow::lossless || terms_.policy == ise::overflow::disconnect) return;
            break;
        default: break;
    }
    journal_.broken("{}: its subscription to {} ended as {}: {}", who_, provider_, ise::name_of(why.code()),
                    why.message());
}

void reading::finish(const ise::subscription_counts& counts, bool queue_empty) {
    if (life_ == 0) {
        // Nothing came: then nothing was published since, unless the rate limit left it out.
        if (life_at_commit_ && press_.at(life_at_commit_).open &&
            press_.at(life_at_commit_).published > published_at_commit_ && !limited())
            journal_.broken("{}: nothing came from {}, which published {} packets since", who_, provider_,
                            press_.at(life_at_commit_).published - published_at_commit_);
        return;
    }
    const auto& source = press_.at(life_);
    if (!source.open) return journal_.broken("{}: is still with life {} of {}, which is over", who_, life_, provider_);
    if (!queue_empty) return;
    auto newest = planted_.strikes_once(bug::tail_lost) && number_ > 0 ? number_ - 1 : number_;
    if (!limited() && newest != source.published)
        return journal_.broken("{}: the newest packet of {} is {}, and {} were published", who_, provider_, newest,
                               source.published);
    if (first_ != 0) {
        auto passed = number_ - first_ + 1;
        auto result = received_ + lost_;
        if (result > passed || result + (limited() ? counts.skipped : 0) < passed)
            journal_.broken("{}: of packets {} to {} of {} came {}, and {} were told lost", who_, first_, number_,
                            provider_, received_, lost_);
    }
    if (all_received_ + counts.lost_here != counts.received)
        journal_.broken("{}: took {} packets, and {} are counted, of which {} were dropped", who_, all_received_,
                        counts.received, counts.lost_here);
    if (unknown_gaps_ == 0 && all_lost_ != counts.lost_at_provider + counts.lost_here)
        journal_.broken("{}: the gaps told of {} packets, the counts of {} and {}", who_, all_lost_,
                        counts.lost_at_provider, counts.lost_here);
}

} // namespace seeds
