#include <components/seal/boat_seal.hpp>

#include <components/boat/layout.hpp>

#include <utility>

namespace atirma::seal {
namespace {

// False: that counter was accepted before, or may have been.
bool admit(boat_counters::of_lane& lane, std::uint64_t counter) {
    if (counter > lane.highest) {
        auto by = counter - lane.highest;
        lane.seen = (by < boat_counters::window ? lane.seen << by : 0) | 1;
        lane.highest = counter;
        return true;
    }
    auto behind = lane.highest - counter;
    if (behind >= boat_counters::window || (lane.seen >> behind & 1) != 0) return false;
    lane.seen |= std::uint64_t{1} << behind;
    return true;
}

} // namespace

boat_seal::boat_seal(radio_key key, std::optional<boat_counters> kept, std::uint64_t random, store keep)
    : key_(std::move(key)), keep_(std::move(keep)), notice_due_(!kept || kept->of == no_session) {
    if (!notice_due_) counters_ = *kept;
    else counters_.of = random != no_session ? random : 1;
}

ise::result<ise::bytes> boat_seal::open(ise::bytes_view raw) {
    auto frame = open_to_boat(key_, counters_.of, raw);
    if (!frame) {
        if (is_sealed(raw) && epoch_of(raw) == key_.epoch) notice_due_ = true;
        if (open_to_boat(key_, no_session, raw))
            return ise::failure(ise::errc::refused,
                                "the shore does not know the session of the boat's counters: a notice tells it");
        return frame.error();
    }
    auto next = counters_;
    if (!admit(next.lanes[static_cast<std::size_t>(frame->lane)], frame->counter)) {
        notice_due_ = true;
        return ise::failure(ise::errc::refused, "a sealed packet was repeated, or is too old");
    }
    if (auto kept = keep_(next); !kept) return kept.error();
    counters_ = next;
    if (frame->type == ask_type) {
        notice_due_ = true;
        return ise::bytes();
    }
    ise::bytes plain{static_cast<std::byte>(layout::version), static_cast<std::byte>(frame->type)};
    plain.insert(plain.end(), frame->content.begin(), frame->content.end());
    auto checksum = layout::crc16(plain);
    plain.push_back(static_cast<std::byte>(checksum & 0xFF));
    plain.push_back(static_cast<std::byte>(checksum >> 8));
    return plain;
}

ise::bytes boat_seal::notice() const {
    boat_notice made;
    made.of = counters_.of;
    for (std::size_t i = 0; i < made.highest.size(); ++i) made.highest[i] = counters_.lanes[i].highest;
    return seal(encode_notice(made));
}

} // namespace atirma::seal
