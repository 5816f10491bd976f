#include <ise/net/authentication.hpp>

#include <fmt/format.h>

namespace ise::net {

void authentication::note(const wire::frame_header& header, bytes_view body) {
    if (!key_) return;
    wire::put_header(transcript_, header);
    transcript_.append(body);
}

wire::credentials authentication::offer() {
    wire::credentials made;
    if (!key_) return made;
    made.scheme = scheme;
    while (made.proof.size() < nonce_bytes) {
        auto drawn = env_.random();
        for (int byte = 0; byte < 8; ++byte) made.proof.push_back(static_cast<std::uint8_t>(drawn >> (8 * byte)));
    }
    return made;
}

std::optional<failure> authentication::objection(const wire::credentials& offered) const {
    if (!key_ && offered.scheme.empty()) return {};
    if (!key_)
        return failure(errc::unauthorized, "a proof is asked for that cannot be given: no shared key is known here "
                                           "(start it with --key FILE or ISE_KEY)");
    if (offered.scheme.empty())
        return failure(
            errc::unauthorized,
            "a shared key is demanded here, and none was offered: give the key's file with --key FILE or ISE_KEY");
    if (offered.scheme != scheme || offered.proof.size() != nonce_bytes)
        return failure(
            errc::unauthorized,
            fmt::format("a shared key is demanded here, by the scheme {}, and something else was offered", scheme));
    return {};
}

std::optional<failure> authentication::strange_challenge(const wire::credentials& came) const {
    if (came.scheme == scheme && came.proof.size() == nonce_bytes) return {};
    return failure(errc::protocol_error, fmt::format("its challenge is none of the scheme {}", scheme));
}

wire::credentials authentication::proof(bool of_initiator) const {
    wire::credentials made;
    made.scheme = scheme;
    auto digest = key_->prove(of_initiator ? "ISE1 initiator" : "ISE1 responder", transcript_.view());
    made.proof.assign(digest.begin(), digest.end());
    return made;
}

bool authentication::same(const wire::credentials& wanted, const wire::credentials& given) noexcept {
    return given.scheme == wanted.scheme && shared_key::equal(wanted.proof, given.proof);
}

} // namespace ise::net
