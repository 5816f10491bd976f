#pragma once
#include <components/mqtt_bridge/broker_session.hpp>
#include <components/mqtt_bridge/outgoing_queue.hpp>

#include <ise/component/system_watch.hpp>
#include <ise/core/endpoint.hpp>

#include <functional>
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

} // namespace ise::mqtt
