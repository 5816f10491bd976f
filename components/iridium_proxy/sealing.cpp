// What is believed to be of the boat, and how telecommands are sealed.
#include <components/iridium_proxy/iridium_proxy.hpp>
#include <components/iridium_proxy/proxy_state.hpp>

namespace atirma {

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
