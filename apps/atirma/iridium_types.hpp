#pragma once
#include <ise/component/component_type.hpp>

#include <vector>

namespace atirma {

/// The proxy of Iridium, and the emulated modem and gateway.
void add_iridium_types(std::vector<ise::component_type>& to);

} // namespace atirma
