#pragma once
#include <ise/core/result.hpp>
#include <ise/session/contract.hpp>

#include <memory>
#include <optional>
#include <unordered_map>

namespace ise {

/// The schemas of the services that a component provides or uses, by fingerprint. Schemas that peers
/// send are not here: another text can be made for any fingerprint, so a session believes its own peer only.
class schema_cache {
public:
    void add_own(const packet_types& types);
    /// To answer for it.
    std::optional<schema> find(std::uint64_t fingerprint) const;
    /// Only what this program declares: packets discovered at run time (`keep`) may be a peer's invention.
    const schema* find_declared(std::uint64_t fingerprint) const;
    /// Memory that a schema takes.
    static std::size_t cost_of(const schema& of);

    /// Packets of a service that was learnt at run time, kept as long as this book: sessions remember a service by the
    /// address of its types. The same packets are kept once. errc::overloaded beyond a bound.
    result<std::shared_ptr<const packet_types>> keep(const std::shared_ptr<const packet_types>& types);

private:
    struct own {
        schema what;
        bool declared = false;
    };
    bool keeps(const packet_types& types) const;

    std::unordered_map<std::uint64_t, own> own_;
    std::unordered_multimap<std::uint64_t, std::shared_ptr<const packet_types>> kept_; // by their fingerprints together
};

} // namespace ise
