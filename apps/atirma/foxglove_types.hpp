#pragma once
#include <ise/component/component_type.hpp>

#include <functional>
#include <string>

namespace atirma {

/// The gateway for viewers, with the boat on the map and in 3D.
ise::component_type foxglove_gateway_type(std::function<void(const std::string&)> announce);

} // namespace atirma
