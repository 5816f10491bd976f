#include <ise/service/schema_book.hpp>

namespace ise {

void schema_book::add_own(const packet_types& types) {
    for (const auto& packet : types.schemas) own_.emplace(packet.fingerprint(), packet);
}

void schema_book::learn(const schema& received) {
    if (own_.contains(received.fingerprint()) || !learnt_.emplace(received.fingerprint(), received).second) return;
    order_.push_back(received.fingerprint());
    if (order_.size() <= max_learnt) return;
    learnt_.erase(order_.front());
    order_.pop_front();
}

std::optional<schema> schema_book::find(std::uint64_t fingerprint) const {
    if (auto found = own_.find(fingerprint); found != own_.end()) return found->second;
    if (auto found = learnt_.find(fingerprint); found != learnt_.end()) return found->second;
    return std::nullopt;
}

} // namespace ise
