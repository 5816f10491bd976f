#pragma once
#include <components/boat/enums.hpp>
#include <components/communication_node/command_router.hpp>
#include <components/communication_node/link_table.hpp>
#include <components/communication_node/services.hpp>

#include <ise/core/time.hpp>

#include <cstdint>
#include <string>
#include <vector>

namespace atirma {

struct proxy_of_link {
    link_id link = link_id::xbee;
    std::string path; ///< or an endpoint
};

struct communication_node_options {
    std::string file = "communication.db"; ///< of its store; "memory:NAME" on the virtual world
    std::string store;                     ///< postgresql://… instead of the file; shared by all nodes of the boat
    bool secondary = false;                ///< backs the primary: the lower priority under the role
    std::string peer;                      ///< path of the other node; empty: it stands alone
    std::vector<proxy_of_link> proxies;
    std::string role = std::string(communication_role); ///< empty: it serves none
    ise::duration silence = std::chrono::seconds(3);    ///< the other node is given up for so long; at least 1 s
    std::size_t max_held = 20'000;                      ///< packets in memory while the disk takes none
    ise::duration state_period = std::chrono::seconds(2);
    std::uint64_t max_packets = 5'000'000; ///< on disk; then the oldest go. A gigabyte, and weeks at sea
    std::uint64_t max_commands = 100'000;  ///< on record, the same
    std::vector<link_terms> links = usual_links();
    desk_options desk;
    bool raw_telecommands = false; ///< whether raw telecommands may be sent
};

} // namespace atirma
