// What is believed to be of the boat, and how telecommands are sealed.
#include <components/iridium_proxy/iridium_proxy.hpp>
#include <components/iridium_proxy/proxy_state.hpp>

namespace atirma {

void iridium_proxy::open_seal() {
    if (options_.radio_key_file.empty()) {
        log().warning("the radio is not sealed: whoever can send on this link is taken for the boat (set radio-key)",
                      {});
        return;
    }
    when_damaged damaged(log(), [this] { return std::chrono::floor<std::chrono::system_clock::duration>(wall()); });
    auto& s = *state_;
    s.seal = std::move(seal::shore_link::open(env(), options_.radio_key_file, link_id::iridium,
                                              options_.radio_secondary, std::move(damaged))
                           .value());
    log().info("the radio is sealed", {{"boat", s.seal->key().boat}, {"key", seal::fingerprint(s.seal->key())}});
}

/// The plain packet when it comes; empty for one about the seal only. A question for the boat is not worth a message: a
/// telecommand asks as well.
ise::result<ise::bytes> iridium_proxy::opened(ise::bytes raw) {
    if (!state_->seal) return raw;
    auto got = state_->seal->open(raw);
    if (!got) return got.error();
    return std::move(got->plain);
}

/// The same of a message that came before: its notices may be older than what is known now.
ise::result<ise::bytes> iridium_proxy::read_sealed(ise::bytes raw) const {
    if (!state_->seal) return raw;
    return state_->seal->read(raw);
}

/// A message for the boat. Each attempt is sealed anew: the boat accepts a counter once.
ise::result<ise::bytes> iridium_proxy::sealed(const ise::bytes& raw) {
    auto& s = *state_;
    if (!s.seal) return raw;
    return s.seal->seal(raw);
}

} // namespace atirma
