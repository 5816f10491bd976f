#include <components/seal/shore_seal.hpp>

#include <components/boat/layout.hpp>
#include <components/seal/boat_notice.hpp>

#include <algorithm>

namespace atirma::seal {

ise::result<std::uint64_t> counter_source::next() {
    if (next_ > max_counter)
        return ise::failure(ise::errc::refused, "all counters of the radio's key are used: make a new key");
    if (next_ >= reserved_) {
        auto until = std::min(next_ + block, max_counter + 1);
        if (auto kept = keep_(until); !kept) return kept.error();
        reserved_ = until;
    }
    return next_++;
}

void counter_source::skip(std::uint64_t seen) noexcept { next_ = std::max(next_, std::min(seen, max_counter) + 1); }

ise::result<ise::bytes> shore_seal::seal(ise::bytes_view plain) {
    if (plain.size() < layout::header_size + layout::checksum_size)
        return ise::failure(ise::errc::malformed, "the packet to seal is too short");
    auto counter = counters_.next();
    if (!counter) return counter.error();
    to_boat_frame frame;
    frame.type = std::to_integer<std::uint8_t>(plain[1]);
    frame.lane = lane_;
    frame.counter = *counter;
    frame.content.assign(plain.begin() + 2, plain.end() - static_cast<std::ptrdiff_t>(layout::checksum_size));
    return seal_to_boat(key_, frame);
}

ise::result<shore_seal::opened> shore_seal::open(ise::bytes_view raw) {
    auto plain = open_from_boat(key_, raw);
    if (!plain) return plain.error();
    opened made;
    if ((*plain)[1] != static_cast<std::byte>(notice_type)) {
        made.plain = std::move(*plain);
        return made;
    }
    auto notice = parse_notice(*plain);
    if (!notice) return notice.error();
    auto at = static_cast<std::size_t>(lane_);
    counters_.skip(notice->highest[at]);
    if (notice->known[at]) return made;
    auto counter = counters_.next();
    if (!counter) return counter.error();
    to_boat_frame frame;
    frame.type = resync_type;
    frame.lane = lane_;
    frame.counter = *counter;
    for (std::size_t i = 0; i < 8; ++i)
        frame.content.push_back(static_cast<std::byte>(notice->challenge >> (8 * i) & 0xFF));
    made.resync = seal_to_boat(key_, frame);
    return made;
}

} // namespace atirma::seal
