#include "replaying.hpp"

#include <components/communication_node/communication_node.hpp>

#include <ise/database/database.hpp>

#include <fmt/format.h>

#include <memory>
#include <utility>
#include <vector>

namespace atirma::stress {

ise::replay_report replay_nodes(const std::string& file, const std::string& out, ise::log_sink log) {
    static int number = 0; // several in one process have disks of their own
    const auto disks = fmt::format("memory:replay{}-", ++number);
    std::vector<ise::database> held; // they outlive the nodes
    ise::replay_options options;
    options.out = out;
    options.log = std::move(log);
    // Numbers of stores are drawn at random; the state of a node has times and counts of its own life. A recording has
    // the times at which packets came to the recorder, not to the node: times of arrival differ by their ways.
    options.ignored = {"store", "peer_store", "seen", "at", "asked_at", "communication_state/*"};
    for (int which = 1; which <= 2; ++which) {
        communication_node_options node;
        node.file = disks + std::to_string(which);
        node.secondary = which == 2;
        node.peer = fmt::format("atirma/shore/node-{}", 3 - which);
        node.proxies = {{link_id::xbee, "atirma/shore/xbee"},
                        {link_id::gprs, "atirma/shore/gprs"},
                        {link_id::iridium, "atirma/shore/iridium"}};
        held.push_back(ise::database::open(node.file, {}).value());
        ise::replayed_component one;
        one.path = fmt::format("atirma/shore/node-{}", which);
        one.make = [node] { return std::make_unique<communication_node>(node); };
        options.components.push_back(std::move(one));
    }
    ise::replay_world world(1);
    return world.play(file, options);
}

} // namespace atirma::stress
