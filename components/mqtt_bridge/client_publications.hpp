#pragma once
#include <components/mqtt_bridge/bridge_context.hpp>
#include <components/mqtt_bridge/broker_session.hpp>

#include <ise/component/introspection.hpp>

#include <map>
#include <memory>
#include <string>
#include <utility>

namespace ise::mqtt {

/// The services that the bridge provides for MQTT clients, which publish to them by messages (`publish`). Used on the
/// component's loop.
class client_publications {
public:
    explicit client_publications(std::shared_ptr<bridge_context> in);
    ~client_publications();

    /// The types of a service's packets are those of a component that uses it.
    void learn(const std::string& path, const service_info& service);
    /// Publishes the packet of a message of a client.
    void take(const message& what);

private:
    struct inlet;
    std::shared_ptr<bridge_context> in_;
    std::map<std::string, std::unique_ptr<inlet>> all_; // by service
};

} // namespace ise::mqtt
