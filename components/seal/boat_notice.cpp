#include <components/seal/boat_notice.hpp>

#include <components/boat/layout.hpp>

namespace atirma::seal {

ise::bytes encode_notice(const boat_notice& notice) {
    layout::writer out(notice_type, packet_header());
    out.integer(notice.of);
    for (auto highest : notice.highest) out.integer(highest);
    return out.finish();
}

ise::result<boat_notice> parse_notice(ise::bytes_view plain) {
    layout::reader in(plain);
    if (in.ok() && in.type != notice_type) in.fail("the packet is not a notice about the seal");
    boat_notice made;
    made.of = in.integer<session>();
    if (in.ok() && made.of == no_session) in.fail("a notice about the seal names no session");
    for (auto& highest : made.highest) {
        highest = in.integer<std::uint64_t>();
        if (in.ok() && highest > max_counter) in.fail("a notice about the seal names a counter above 2^40");
    }
    if (auto done = in.finish(); !done) return done.error();
    return made;
}

} // namespace atirma::seal
