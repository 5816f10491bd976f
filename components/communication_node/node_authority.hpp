#pragma once
#include <components/communication_node/authority_book.hpp>
#include <components/communication_node/other_node.hpp>
#include <components/communication_node/store_keeper.hpp>

#include <functional>
#include <optional>
#include <string>

namespace atirma {

/// The authority over the boat at this node: on disk, at the other node, and published.
class node_authority {
public:
    /// `changed_hands` is called after each new epoch that this node assigned, once the store is known to have it.
    node_authority(node_context& here, store_keeper& store, other_node& peer, const opened_store& opened,
                   std::function<void()> changed_hands);

    authority_book& book() noexcept { return book_; }
    const authority_state& now() const noexcept { return book_.now(); }
    /// What is on disk already.
    void set(const authority_state& state, std::uint64_t change);
    /// What a damaged store held, if it is newer.
    void restore(const authority_state& state, std::uint64_t change);
    void begin_anew(); ///< the store is a new one

    ise::task<authority_state> change(authority_request request, std::string who); ///< the service

private:
    node_context& here_;
    store_keeper& store_;
    other_node& peer_;
    std::function<void()> changed_hands_;
    authority_book book_;
    std::optional<std::uint32_t> unconfirmed_; // an epoch of this node that may be in the store
    ise::publication<ise::subscription<authority_state>> authorities_;
};

} // namespace atirma
