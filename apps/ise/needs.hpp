#pragma once
#include "survey.hpp"

#include <cstdint>
#include <string>
#include <vector>

namespace ise::cli {

/// A service of a system, by name and kind: others may use the same word for something else.
struct service_line {
    std::string name;
    const service_info* example = nullptr; ///< as one of them describes it, in what was surveyed
    std::vector<std::string> providers;    ///< paths
    std::vector<std::string> users;        ///< paths: declared it, or were seen to use it
    bool missing = false;                  ///< declared by a user, and no component provides it

    /// Whether one of them is `prefix` or lies below it.
    bool concerns(const std::string& prefix) const;
};

/// By name. `own`: ISE's own services, too. None is missing while a component does not answer: it may provide it.
std::vector<service_line> services_of(const std::vector<surveyed>& all, bool own);

} // namespace ise::cli
