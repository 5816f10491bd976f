#include <ise/session/schema_cache.hpp>

#include <ise/core/limits.hpp>

#include <fmt/format.h>

namespace ise {
namespace {

// A text of three letters may stand for a type that takes a hundred times as much.
std::size_t memory_of(const type_description& type) {
    std::size_t all = type.name.capacity() + type.enumerators.capacity() * sizeof(enumerator);
    for (const auto& one : type.enumerators) all += one.name.capacity();
    all += (type.members.capacity() - type.members.size()) * sizeof(type_member);
    for (const auto& member : type.members)
        all += sizeof(type_member) + member.name.capacity() + (member.preset ? member.preset->capacity() : 0) +
               memory_of(member.type);
    return all;
}

} // namespace

void schema_cache::add_own(const packet_types& types) {
    for (const auto& packet : types.schemas) own_.emplace(packet.fingerprint(), packet);
}

void schema_cache::learn(const schema& received) {
    if (own_.contains(received.fingerprint()) || learnt_.contains(received.fingerprint())) return;
    const auto cost = cost_of(received);
    learnt_.emplace(received.fingerprint(), learnt{received, cost});
    order_.push_back(received.fingerprint());
    learnt_bytes_ += cost;
    while (order_.size() > limit::learnt_schemas || learnt_bytes_ > limit::learnt_schema_bytes) {
        auto oldest = learnt_.find(order_.front());
        order_.pop_front();
        learnt_bytes_ -= oldest->second.cost;
        learnt_.erase(oldest);
    }
}

std::optional<schema> schema_cache::find(std::uint64_t fingerprint) const {
    if (auto found = own_.find(fingerprint); found != own_.end()) return found->second;
    if (auto found = learnt_.find(fingerprint); found != learnt_.end()) return found->second.what;
    return std::nullopt;
}

std::size_t schema_cache::cost_of(const schema& result) const {
    return own_.contains(result.fingerprint())
               ? 0
               : sizeof(type_description) + result.text().capacity() + memory_of(result.type());
}

result<std::shared_ptr<const packet_types>> schema_cache::keep(const std::shared_ptr<const packet_types>& types) {
    std::uint64_t key = 0;
    for (auto fingerprint : types->fingerprints) key = key * 31 + fingerprint;
    for (auto [at, end] = kept_.equal_range(key); at != end; ++at)
        // Texts are compared too: defaults take no part in fingerprints.
        if (at->second == types || (at->second->kind == types->kind && at->second->schemas == types->schemas))
            return at->second;
    if (kept_.size() >= limit::kept_services)
        return failure(errc::overloaded,
                       fmt::format("a component uses at most {} services that it learnt of at run time (kept_services)",
                                   limit::kept_services));
    kept_.emplace(key, types);
    return types;
}

} // namespace ise
