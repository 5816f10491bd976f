#include <ise/service/schema_book.hpp>

#include <ise/core/limits.hpp>

#include <fmt/format.h>

namespace ise {

void schema_book::add_own(const packet_types& types) {
    for (const auto& packet : types.schemas) own_.emplace(packet.fingerprint(), packet);
}

void schema_book::learn(const schema& received) {
    if (own_.contains(received.fingerprint()) || !learnt_.emplace(received.fingerprint(), received).second) return;
    order_.push_back(received.fingerprint());
    learnt_bytes_ += received.text().size();
    while (order_.size() > limit::learnt_schemas || learnt_bytes_ > limit::learnt_schema_bytes) {
        auto oldest = learnt_.find(order_.front());
        order_.pop_front();
        learnt_bytes_ -= oldest->second.text().size();
        learnt_.erase(oldest);
    }
}

std::optional<schema> schema_book::find(std::uint64_t fingerprint) const {
    if (auto found = own_.find(fingerprint); found != own_.end()) return found->second;
    if (auto found = learnt_.find(fingerprint); found != learnt_.end()) return found->second;
    return std::nullopt;
}

result<std::shared_ptr<const packet_types>> schema_book::keep(const std::shared_ptr<const packet_types>& types) {
    std::uint64_t key = 0;
    for (auto fingerprint : types->fingerprints) key = key * 31 + fingerprint;
    for (auto [at, end] = kept_.equal_range(key); at != end; ++at)
        // Texts are compared too: defaults take no part in fingerprints.
        if (at->second == types || (at->second->kind == types->kind && at->second->schemas == types->schemas)) return at->second;
    if (kept_.size() >= limit::kept_services)
        return failure(errc::overloaded, fmt::format("a component uses at most {} services that it learnt of at run time (kept_services)", limit::kept_services));
    kept_.emplace(key, types);
    return types;
}

} // namespace ise
