#pragma once
#include "taps.hpp"

#include <ise/component/component.hpp>

#include <memory>

namespace atirma::stress {

/// Two ends, and who reads along. What comes from `near` is `wrote`, what goes to it is `read`.
struct wire {
    std::unique_ptr<ise::stream> near, far;
    std::unique_ptr<tap> by;
};

/// Passes on what comes, both ways, until one end is gone; then closes the other.
ise::task<> carry(ise::component& self, std::shared_ptr<wire> what);

} // namespace atirma::stress
