#pragma once
/// The whole of ISE for a program: components, nodes, services, packets. Virtual worlds are in <ise/sim/world.hpp>.
#include <ise/component/component.hpp>
#include <ise/component/node.hpp>
#include <ise/core/real/environment.hpp>
#include <ise/packet/json.hpp>
