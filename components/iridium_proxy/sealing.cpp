// What is believed to be of the boat, and how telecommands are sealed.
#include <components/iridium/bundle.hpp>
#include <components/iridium/message.hpp>
#include <components/iridium_proxy/iridium_proxy.hpp>
#include <components/iridium_proxy/proxy_state.hpp>

namespace atirma {

/// The plain packet when it comes; empty for one about the seal only. A packet about the seal is not worth a message:
/// telecommands take it along.
ise::result<ise::bytes> iridium_proxy::opened(ise::bytes raw) {
    if (!state_->seal) return raw;
    return state_->seal->open(raw);
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
    auto made = s.seal->seal(raw);
    auto rekey = made ? s.seal->rekey() : ise::bytes();
    if (rekey.empty()) return made;
    const ise::bytes both[] = {std::move(*made), std::move(rekey)}; // the key is changed behind the telecommand
    std::size_t taken = 0;
    return iridium::bundle(both, iridium::max_mt_bytes, taken);
}

} // namespace atirma
