#pragma once
/// ISE's cereal archives, and what it takes for types with a `serialize` of their own to be packets.
#include <ise/packet/detail/archives.hpp>
#include <ise/packet/detail/by_cereal.hpp>
