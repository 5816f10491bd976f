#pragma once
#include <string>

namespace ise {

/// What the people who run a component should know of how it was set up, although it works: `ise doctor` shows it as a
/// warning.
struct caution {
    std::string message; ///< what is so, and what follows from it
    std::string advice;  ///< what to do about it
    bool operator==(const caution&) const = default;
};

} // namespace ise
