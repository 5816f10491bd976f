#pragma once
#include <ise/component/component_type.hpp>

#include <functional>
#include <string>

namespace atirma {

/// `nmea-bridge`; `announce` hears where it listens.
ise::component_type nmea_bridge_type(std::function<void(const std::string&)> announce);

} // namespace atirma
