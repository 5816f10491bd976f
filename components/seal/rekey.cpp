#include <components/seal/rekey.hpp>

#include <fmt/format.h>

#include <algorithm>

namespace atirma::seal {
namespace {

// So that it is the key of no link, whatever its file says.
radio_key of_recovery(radio_key key) {
    key.epoch = 0;
    key.link = "recovery";
    return key;
}

} // namespace

ise::bytes rekey_content(const radio_key& next) {
    ise::bytes made{static_cast<std::byte>(next.epoch)};
    made.insert(made.end(), next.secret.begin(), next.secret.end());
    return made;
}

ise::result<radio_key> parse_rekey(ise::bytes_view content, const radio_key& like) {
    if (content.size() != rekey_size)
        return ise::failure(ise::errc::malformed,
                            fmt::format("a change of the key has {} bytes, not {}", rekey_size, content.size()));
    auto made = like;
    made.epoch = std::to_integer<std::uint8_t>(content[0]);
    if (made.epoch > max_epoch)
        return ise::failure(ise::errc::malformed,
                            fmt::format("the epoch of a key is 0 to {}, not {}", max_epoch, made.epoch));
    std::copy(content.begin() + 1, content.end(), made.secret.begin());
    return made;
}

ise::bytes seal_recovery(const radio_key& recovery, std::uint64_t generation, const radio_key& next) {
    to_boat_frame frame;
    frame.type = rekey_type;
    frame.counter = generation;
    frame.content = rekey_content(next);
    return seal_to_boat(of_recovery(recovery), no_session, frame);
}

ise::result<recovered_key> open_recovery(const radio_key& recovery, ise::bytes_view raw) {
    auto frame = open_to_boat(of_recovery(recovery), no_session, raw);
    if (!frame) return frame.error();
    if (frame->type != rekey_type)
        return ise::failure(ise::errc::refused, "the recovery key seals nothing but a change of the key");
    auto like = recovery;
    like.link.clear();
    auto next = parse_rekey(frame->content, like);
    if (!next) return next.error();
    recovered_key made;
    made.next = std::move(*next);
    made.generation = frame->counter;
    return made;
}

} // namespace atirma::seal
