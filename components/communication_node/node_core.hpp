#pragma once
// Private to this folder: what a node has while it runs.
#include <components/boat/find_component.hpp>
#include <components/boat/newest_by_kind.hpp>
#include <components/boat/notifier.hpp>
#include <components/boat/telecommand_audience.hpp>
#include <components/communication_node/authority_book.hpp>
#include <components/communication_node/command_router.hpp>
#include <components/communication_node/node_store.hpp>
#include <components/communication_node/options.hpp>
#include <components/communication_node/peer_watch.hpp>
#include <components/communication_node/services.hpp>

#include <ise/component/component.hpp>

#include <deque>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace atirma {

struct node_core {
    node_core(ise::component& of, node_store opened, const communication_node_options& options,
              std::function<void()> work, std::function<void()> tick)
        : store(std::move(opened)), links(options.links), desk(options.desk), audience(of),
          authority(options.secondary), peer(!options.peer.empty(), options.silence, of.now()), news(of.on()),
          progress(of.on()), due(of.on(), std::move(work)), silence(of.on(), std::move(tick)),
          proxies(options.proxies.size()) {}

    struct proxy_state {
        ise::remote proxy;
        const ise::subscriber<ise::subscription<telemetry_packet>>* stream = nullptr;
        link_health health;
    };

    node_store store;
    link_table links;
    command_router desk;
    telecommand_audience audience;
    authority_book authority;
    peer_watch peer;
    newest_by_kind newest;
    notifier news;     // something that the other node does not have
    notifier progress; // it has more, or is given up
    ise::timer due, silence;
    std::vector<proxy_state> proxies;

    std::deque<telemetry_packet> held;
    std::map<std::uint32_t, command_record> unsaved; // changes that the disk did not take
    std::uint64_t shown = 0;
    std::string trouble, peer_trouble;
    std::string store_notice;  // what happened to the store in this life: set back, or damaged and set aside
    bool refilling = false;    // the store is a new one in the place of a damaged one, and not all of it is there again
    std::size_t salvaging = 0; // files set aside that are still read
    store_part told_back;      // what the other node knew of the store when it was last said to have gone back
    bool serving = false, caught_up = false, working = false;
    std::uint64_t duplicates = 0, refused = 0, dropped = 0;
    std::optional<current_fix> fix;
    ise::time_point next_state{}, next_prune{};

    ise::publication<ise::subscription<telemetry_packet>> telemetry;
    ise::publication<ise::subscription<authority_state>> authorities;
    ise::publication<ise::subscription<communication_state>> state;
};

} // namespace atirma
