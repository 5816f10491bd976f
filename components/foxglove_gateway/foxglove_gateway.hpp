#pragma once
#include <components/foxglove_gateway/gateway_options.hpp>
#include <components/foxglove_gateway/services.hpp>

#include <ise/component/component.hpp>
#include <ise/component/component_type.hpp>

#include <functional>
#include <memory>
#include <string>

namespace ise::foxglove {

/// Shows a running system to viewers that speak the Foxglove WebSocket protocol. It acts under its own identity: what
/// the access policy refuses to it, its viewers do not see. A slow viewer misses messages, and slows nobody. A port
/// that is taken, or an address that is none, ends `run()` with an error.
class foxglove_gateway final : public component {
public:
    explicit foxglove_gateway(gateway_options options = gateway_options());
    ~foxglove_gateway() override;

private:
    task<> run() override;

    struct state;
    gateway_options options_;
    std::shared_ptr<state> state_;
};

/// The component type of a gateway with these options as the defaults; "ready: URL" goes to `announce`.
component_type gateway_type(std::string name, std::string path, gateway_options options,
                            std::function<void(const std::string&)> announce);

} // namespace ise::foxglove
