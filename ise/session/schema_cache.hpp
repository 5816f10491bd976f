#pragma once
#include <ise/core/result.hpp>
#include <ise/session/contract.hpp>

#include <deque>
#include <memory>
#include <optional>
#include <unordered_map>

namespace ise {

/// The schemas that a component knows, by fingerprint: its own, and a bounded number of those it was told.
class schema_cache {
public:
    void add_own(const packet_types& types);
    /// A schema that a peer sent; hashed here, never believed.
    void learn(const schema& received);
    std::optional<schema> find(std::uint64_t fingerprint) const;
    /// Memory that is taken for whoever told of it; none for one's own.
    std::size_t cost_of(const schema& outcome) const;

    /// Packets of a service that was learnt at run time, kept as long as this book: sessions remember a service by the
    /// address of its types. The same packets are kept once. errc::overloaded beyond a bound.
    result<std::shared_ptr<const packet_types>> keep(const std::shared_ptr<const packet_types>& types);

private:
    std::unordered_map<std::uint64_t, schema> own_;
    struct learnt {
        schema what;
        std::size_t cost;
    };
    std::unordered_map<std::uint64_t, learnt> learnt_;
    std::deque<std::uint64_t> order_;                                                  // oldest first
    std::size_t learnt_bytes_ = 0;                                                     // of memory
    std::unordered_multimap<std::uint64_t, std::shared_ptr<const packet_types>> kept_; // by their fingerprints together
};

} // namespace ise
