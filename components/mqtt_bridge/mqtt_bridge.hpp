#pragma once
#include <components/mqtt_bridge/broker_session.hpp>
#include <components/mqtt_bridge/outgoing_queue.hpp>
#include <components/mqtt_bridge/services.hpp>

#include <ise/component/component.hpp>
#include <ise/component/component_type.hpp>
#include <ise/component/system_watch.hpp>
#include <ise/core/endpoint.hpp>

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace ise::mqtt {

/// Options of a bridge. By default it sends, and accepts neither packets nor calls.
struct bridge_options : service_selection {
    broker_options broker;      ///< `client_id` and `will` are set by the bridge where they are empty
    std::string prefix = "ise"; ///< of all topics
    bool protobuf = false;      ///< else JSON
    bool retain = true;         ///< the broker keeps the last message of each service for new subscribers

    std::vector<std::string> queued; ///< services of which every packet counts; of the others the latest
    std::string store;               ///< file of the queue and of calls; empty: in memory only
    queue_limits queue;

    bool allow_calls = false; ///< MQTT clients call services
    duration call_deadline = std::chrono::seconds(10);
    duration remember = std::chrono::hours(24); ///< requests, so that they are not executed again
    std::vector<std::string> publish;           ///< services that MQTT clients publish to; the bridge provides them

    std::vector<endpoint> name_servers; ///< default: ISE_NAME_SERVER, else that of this machine
    broker_connector connect = connect_mosquitto;
    std::function<void(const std::string& url)> on_connected; ///< on the component's loop
};

/// Connects a running system to an MQTT broker. It acts under its own identity: what the access policy refuses to it is
/// not in the broker either. While the broker is away, packets of queued services wait on disk, bounded, and go out in
/// order, marked as history. Wrong options and a store that cannot be opened end `run()` with an error. It waits for a
/// broker that is absent.
class mqtt_bridge final : public component {
public:
    explicit mqtt_bridge(bridge_options options = bridge_options());
    ~mqtt_bridge() override;

private:
    task<> run() override;

    struct state;
    bridge_options options_;
};

/// The component type of a bridge with these options as the defaults; "ready: URL" goes to `announce` at the first
/// connection.
component_type bridge_type(std::string name, std::string path, bridge_options options,
                           std::function<void(const std::string&)> announce);

} // namespace ise::mqtt
