#pragma once
/// ISE's cereal archives; required for packets with a `serialize` function of their own.
#include <ise/packet/detail/archives.hpp>
#include <ise/packet/detail/by_cereal.hpp>
