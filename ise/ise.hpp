#pragma once
/// Components, nodes, services and packets. Further headers: <ise/component/component_type.hpp> (`ise::main`),
/// <ise/asio.hpp>, <ise/core/loop.hpp>, <ise/packet/archive.hpp> (cereal), <ise/packet/bounded.hpp>,
/// <ise/service/dynamic.hpp>, <ise/sim/world.hpp>, and those that the API reference lists.
#include <ise/component/component.hpp>
#include <ise/component/node.hpp>
#include <ise/core/real/environment.hpp>
#include <ise/packet/json.hpp>
