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

std::optional<std::uint64_t> challenge_in(const ise::bytes& content) {
    if (content.size() != 8) return std::nullopt;
    std::uint64_t value = 0;
    for (std::size_t i = 0; i < 8; ++i) value |= std::to_integer<std::uint64_t>(content[i]) << (8 * i);
    return value;
}

} // namespace

ise::result<ise::bytes> boat_seal::open(ise::bytes_view raw) {
    auto frame = open_to_boat(key_, raw);
    if (!frame) return frame.error();
    auto next = counters_;
    auto& lane = next.lanes[static_cast<std::size_t>(frame->lane)];
    bool resync = frame->type == resync_type;
    if (!lane.known) {
        if (!resync || challenge_in(frame->content) != challenge_) {
            notice_due_ = true;
            return ise::failure(ise::errc::refused,
                                "the boat has lost its memory of counters: it obeys a resync over its notice only");
        }
        // Everything up to this counter counts as seen: it was sealed before.
        lane = {.known = true, .highest = frame->counter, .seen = ~std::uint64_t{0}};
    } else if (!admit(lane, frame->counter)) {
        notice_due_ = true;
        return ise::failure(ise::errc::refused, "a sealed packet was repeated, or is too old");
    }
    if (auto kept = keep_(next); !kept) return kept.error();
    counters_ = next;
    if (resync) return ise::bytes();
    ise::bytes plain{static_cast<std::byte>(layout::version), static_cast<std::byte>(frame->type)};
    plain.insert(plain.end(), frame->content.begin(), frame->content.end());
    auto checksum = layout::crc16(plain);
    plain.push_back(static_cast<std::byte>(checksum & 0xFF));
    plain.push_back(static_cast<std::byte>(checksum >> 8));
    return plain;
}

ise::bytes boat_seal::notice() const {
    boat_notice made;
    made.challenge = challenge_;
    for (std::size_t i = 0; i < 2; ++i) {
        made.known[i] = counters_.lanes[i].known;
        made.highest[i] = counters_.lanes[i].highest;
    }
    return seal(encode_notice(made));
}

} // namespace atirma::seal
