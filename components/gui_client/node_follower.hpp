#pragma once
#include <components/boat/communication.hpp>
#include <components/gui_client/followed_stream.hpp>

#include <map>
#include <string>

namespace atirma::console {

/// Follows the communication nodes: the state of each, and the role that they serve together, with the record of the
/// telemetry, the telecommands of all operators and the authority.
class node_follower {
public:
    /// `look_back`: how much of the record is asked for.
    node_follower(client_context& context, std::string role, ise::duration look_back, std::size_t max_nodes);

    /// Follows the node at `path`, and with the first one the role.
    void follow(const std::string& path);
    /// Reports to the state which nodes are reached, and whether the role is.
    void report();

private:
    void follow_role();
    void follow_authority();
    ise::task<> follow_record();

    client_context& context_;
    std::string role_;
    ise::duration look_back_;
    std::size_t max_nodes_;
    std::map<std::string, stream_health> nodes_; ///< by path
    stream_health record_;
};

} // namespace atirma::console
