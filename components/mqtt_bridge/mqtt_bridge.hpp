#pragma once
#include <components/mqtt_bridge/bridge_options.hpp>
#include <components/mqtt_bridge/services.hpp>

#include <ise/component/component.hpp>
#include <ise/component/component_type.hpp>

#include <functional>
#include <string>

namespace ise::mqtt {

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
