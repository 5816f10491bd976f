#include "foxglove_types.hpp"

#include <components/foxglove_boat/boat_channels.hpp>
#include <components/foxglove_gateway/foxglove_gateway.hpp>

#include <utility>

namespace atirma {

ise::component_type foxglove_gateway_type(std::function<void(const std::string&)> announce) {
    ise::foxglove::gateway_options options;
    options.paths = {"atirma"};
    options.derivations = {boat_channels};
    return ise::foxglove::gateway_type("foxglove-boat", "atirma/foxglove", std::move(options), std::move(announce));
}

} // namespace atirma
