#pragma once
#include <components/communication_node/kept_telemetry.hpp>
#include <components/communication_node/node_telecommands.hpp>

#include <string>

namespace atirma {

/// Two nodes that back each other: each requests from the other what it does not have, and acknowledges by that what it
/// has; and whether this one serves the role.
class replication {
public:
    replication(node_context& here, store_keeper& store, other_node& peer, kept_telemetry& telemetry,
                node_authority& authority, node_telecommands& telecommands);

    void start();
    /// Serves the role or leaves it: call it when the disk, the other node or what is kept may have changed. A node
    /// serves if it can keep what it gets and has what the other node has, or if it is alone.
    void consider_serving();
    void report(communication_state& into) const;

    ise::task<replication_page> tell(replication_request request); ///< the service

private:
    ise::task<> follow();
    ise::result<void> take(replication_page page);
    void went_back(const store_part& known_there, const store_part& shared);

    node_context& here_;
    store_keeper& store_;
    other_node& peer_;
    kept_telemetry& telemetry_;
    node_authority& authority_;
    node_telecommands& telecommands_;
    bool serving_ = false;
    std::string trouble_;  // why nothing comes from the other node
    store_part told_back_; // what the other node knew of the store when it was last reported to have gone back
};

} // namespace atirma
