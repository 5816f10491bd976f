// ise_mqtt_bridge: the component type `mqtt-bridge`, which connects a system to an MQTT broker.
#include <components/mqtt_bridge/mqtt_bridge.hpp>

#include <cstdio>
#include <string>
#include <vector>

int main(int count, char** arguments) {
    auto announce = [](const std::string& line) {
        std::fputs((line + "\n").c_str(), stdout);
        std::fflush(stdout);
    };
    std::vector<ise::component_type> types;
    types.push_back(ise::mqtt::bridge_type("mqtt-bridge", "ise/mqtt", ise::mqtt::bridge_options(), announce));
    return ise::main(count, arguments, std::move(types), ISE_VERSION);
}
