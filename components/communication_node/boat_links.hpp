#pragma once
#include <components/boat/communication.hpp>
#include <components/communication_node/link_table.hpp>
#include <components/communication_node/node_context.hpp>

#include <functional>
#include <string>
#include <vector>

namespace atirma {

/// The proxies of all links: follows the telemetry and the telecommands of each, and knows which of them are reached,
/// and over which the boat was heard.
class boat_links {
public:
    struct actions {
        std::function<void(std::vector<telemetry_packet>)> received;
        std::function<void(link_id, const telecommand_status&)> status;
        std::function<void()> reached; ///< a proxy that was not
    };
    boat_links(node_context& here, actions then);

    void start();
    /// Notes which proxies are reached; their connections end without an event.
    void look();
    /// The boat answered over it, at that time by the clock of its proxy.
    void heard(link_id link, utc_time at);
    void heard(const telemetry_packet& packet);

    const link_table& table() const noexcept { return table_; }
    std::string names() const;        ///< of the links that have a proxy
    ise::remote* proxy(link_id link); ///< null: it has none
    void report(communication_state& into) const;

private:
    struct proxy_state {
        ise::remote remote;
        const ise::subscriber<ise::subscription<telemetry_packet>>* stream = nullptr;
        link_health health;
    };
    proxy_state* find(link_id link);
    ise::task<> follow_telemetry(proxy_state& of);
    ise::task<> follow_telecommands(proxy_state& of);
    void unreached(link_health& health, const ise::error& problem);

    node_context& here_;
    actions then_;
    link_table table_;
    std::vector<proxy_state> proxies_;
};

} // namespace atirma
