#pragma once
#include "taps.hpp"

#include <ise/core/stream.hpp>

#include <memory>

namespace atirma::stress {

/// The far end of a serial line, read along: what its holder reads was written at the device, and the other way round.
std::unique_ptr<ise::stream> tapped_far_end(std::unique_ptr<ise::stream> line, std::unique_ptr<tap> by);

} // namespace atirma::stress
