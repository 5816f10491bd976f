#pragma once
#include <ise/core/transport.hpp>

namespace ise::transports {
extern const transport shm;
}
