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

std::uint64_t key_of(const packet_types& types) {
    std::uint64_t key = 0;
    for (auto fingerprint : types.fingerprints) key = key * 31 + fingerprint;
    return key;
}

} // namespace

void schema_cache::add_own(const packet_types& types) {
    const bool declared = !keeps(types);
    for (const auto& packet : types.schemas) {
        auto& known = own_.try_emplace(packet.fingerprint(), own{packet, declared}).first->second;
        if (declared && !known.declared) known = {packet, true};
    }
}

std::optional<schema> schema_cache::find(std::uint64_t fingerprint) const {
    auto found = own_.find(fingerprint);
    return found == own_.end() ? std::nullopt : std::optional(found->second.what);
}

const schema* schema_cache::find_declared(std::uint64_t fingerprint) const {
    auto found = own_.find(fingerprint);
    return found == own_.end() || !found->second.declared ? nullptr : &found->second.what;
}

std::size_t schema_cache::cost_of(const schema& of) {
    return sizeof(type_description) + of.text().capacity() + memory_of(of.type());
}

bool schema_cache::keeps(const packet_types& types) const {
    for (auto [at, end] = kept_.equal_range(key_of(types)); at != end; ++at)
        if (at->second.get() == &types) return true;
    return false;
}

result<std::shared_ptr<const packet_types>> schema_cache::keep(const std::shared_ptr<const packet_types>& types) {
    const auto key = key_of(*types);
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
