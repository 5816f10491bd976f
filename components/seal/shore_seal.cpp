#include <components/seal/shore_seal.hpp>

#include <components/boat/layout.hpp>
#include <components/seal/boat_notice.hpp>

#include <algorithm>
#include <utility>

namespace atirma::seal {

ise::result<std::uint64_t> shore_seal::next() {
    if (next_ > max_counter)
        return ise::failure(ise::errc::refused, "all counters of the radio's key are used: make a new key");
    if (next_ >= kept_.reserved) {
        auto then = kept_;
        then.reserved = std::min(next_ + block, max_counter + 1);
        if (auto kept = keep_(then); !kept) return kept.error();
        kept_ = then;
    }
    return next_++;
}

ise::result<ise::bytes> shore_seal::seal(ise::bytes_view plain) {
    if (plain.size() < layout::header_size + layout::checksum_size)
        return ise::failure(ise::errc::malformed, "the packet to seal is too short");
    return seal_frame(std::to_integer<std::uint8_t>(plain[1]),
                      ise::bytes(plain.begin() + 2, plain.end() - static_cast<std::ptrdiff_t>(layout::checksum_size)));
}

ise::result<ise::bytes> shore_seal::seal_frame(std::uint8_t type, ise::bytes content) {
    auto counter = next();
    if (!counter) return counter.error();
    to_boat_frame frame;
    frame.type = type;
    frame.lane = lane_;
    frame.counter = *counter;
    frame.content = std::move(content);
    return seal_to_boat(key_, kept_.of, frame);
}

ise::result<ise::bytes> shore_seal::read(ise::bytes_view raw) const {
    auto plain = open_from_boat(key_, raw);
    if (plain && (*plain)[1] == static_cast<std::byte>(notice_type)) plain->clear();
    return plain;
}

ise::result<shore_seal::opened> shore_seal::open(ise::bytes_view raw) {
    auto plain = open_from_boat(key_, raw);
    if (!plain) return plain.error();
    opened made;
    if ((*plain)[1] == static_cast<std::byte>(notice_type)) {
        if (auto done = learn(*plain); !done) return done.error();
        return made;
    }
    made.plain = std::move(*plain);
    if (kept_.of != no_session || std::exchange(asked_, true)) return made;
    // If it fails the boat's packet counts all the same; a telecommand will ask.
    if (auto question = ask()) made.question = std::move(*question);
    return made;
}

// Somebody may repeat an old notice. Then the boat refuses the next packet, and its notice puts that right.
ise::result<void> shore_seal::learn(ise::bytes_view raw) {
    auto notice = parse_notice(raw);
    if (!notice) return notice.error();
    next_ = std::max(next_, notice->highest[static_cast<std::size_t>(lane_)] + 1);
    if (notice->of == kept_.of) return {};
    auto then = kept_;
    then.of = notice->of;
    if (auto kept = keep_(then); !kept) return kept.error();
    kept_ = then;
    return {};
}

} // namespace atirma::seal
