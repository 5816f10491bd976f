#include "communication_types.hpp"

#include <components/boat/recall.hpp>
#include <components/communication_node/communication_node.hpp>
#include <components/communication_node/services.hpp>

#include <fmt/format.h>

namespace atirma {
namespace {

struct choices {
    communication_node_options options;
    std::vector<std::string> proxies{"xbee=atirma/shore/xbee", "gprs=atirma/shore/gprs",
                                     "iridium=atirma/shore/iridium"};
    double silence_s = 3;
};

proxy_of_link proxy_named(const std::string& text) {
    auto at = text.find('=');
    auto link = from_name<link_id>(text.substr(0, at));
    if (at == std::string::npos || at + 1 == text.size() || !link)
        throw ise::error(ise::errc::invalid_argument,
                         fmt::format("--proxy requires LINK=PATH, such as xbee=atirma/shore/xbee (links are xbee, gprs "
                                     "and iridium), not '{}'",
                                     text));
    return {*link, text.substr(at + 1)};
}

} // namespace

ise::component_type communication_node_type() {
    ise::component_type type("communication-node",
                             "the boat over all links together: telemetry, telecommands, authority",
                             "atirma/shore/node-1");
    auto chosen = std::make_shared<choices>();
    auto& options = chosen->options;
    auto& set = type.parameters;
    set.add("file", options.file, "its database (SQLite); each node has its own").kind(ise::parameter_kind::path);
    set.add("store", options.store,
            "database (PostgreSQL) instead of a file, shared by all nodes of the boat; its password comes from "
            "PGPASSFILE or PGPASSWORD");
    set.add("peer", options.peer, "the other node's path; empty: there is none");
    set.add("secondary", options.secondary, "secondary node: the other one is preferred");
    set.add("proxy", chosen->proxies, "a link and the path of its proxy: xbee=atirma/shore/xbee");
    set.add("serves", options.role, "role under which operators and page find the nodes");
    set.add("raw-telecommands", options.raw_telecommands,
            "sends raw telecommands, which neither shore nor boat checks");
    set.add("silence", chosen->silence_s, "time without a message after which the other node counts as lost")
        .range(1, 3600)
        .unit("s");
    type.provides(services::telemetry)
        .provides(services::telemetry_store)
        .provides(services::track)
        .provides(services::communication);
    type.provides(services::telecommand).provides(services::telecommand_state).provides(services::telecommand_record);
    type.provides(services::telecommand_recall).provides(services::raw_telecommand);
    type.provides(services::authority).provides(services::authority_changes).provides(services::replication);
    type.requires_(services::telemetry).requires_(services::telecommand).requires_(services::telecommand_state);
    type.requires_(services::telecommand_recall).requires_(services::replication);
    type.make = [chosen] {
        auto made = chosen->options;
        for (const auto& text : chosen->proxies) made.proxies.push_back(proxy_named(text));
        made.silence = std::chrono::duration_cast<ise::duration>(std::chrono::duration<double>(chosen->silence_s));
        return std::make_unique<communication_node>(std::move(made));
    };
    return type;
}

} // namespace atirma
