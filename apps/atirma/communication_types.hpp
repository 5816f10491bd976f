#pragma once
#include <ise/component/component_type.hpp>

namespace atirma {

/// A communication node: all links together, on two hosts that back each other.
ise::component_type communication_node_type();

} // namespace atirma
