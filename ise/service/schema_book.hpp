#pragma once
#include <ise/service/contract.hpp>

#include <deque>
#include <functional>
#include <map>
#include <optional>
#include <unordered_map>

namespace ise {

/// The schemas that a component knows, by fingerprint: its own, and a bounded number of those it was told.
class schema_book {
public:
    void add_own(const packet_types& types);
    /// A schema that a peer sent; hashed here, never believed.
    void learn(const schema& received);
    std::optional<schema> find(std::uint64_t fingerprint) const;

private:
    static constexpr std::size_t max_learnt = 4096;

    std::unordered_map<std::uint64_t, schema> own_;
    std::unordered_map<std::uint64_t, schema> learnt_;
    std::deque<std::uint64_t> order_; // oldest first
};

} // namespace ise
