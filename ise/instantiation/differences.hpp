#pragma once
#include <ise/instantiation/services.hpp>

#include <optional>
#include <string>
#include <vector>

namespace ise::instantiation {

/// One thing in which an instance is not as it is wanted.
struct difference {
    std::string what;                ///< a parameter's name, or "roles", "endpoints"…
    std::string is, wanted;          ///< for people; empty where the values are not shown
    bool in_place = false;           ///< it can be changed while the component runs
    std::optional<argument> setting; ///< of a parameter that can be changed so
};

/// What of a running instance would have to change to be as `wanted`; its parameters are those of `type`. A parameter
/// that is not given is at its preset. Only its instantiation server can tell of `other_environment`. Nothing: it is as
/// wanted.
std::vector<difference> differences(const instance_info& is, const start_request& wanted, const type_info& type,
                                    bool other_environment);

/// The arguments of a request after some of them were set again.
std::vector<argument> with_settings(std::vector<argument> given, const std::vector<argument>& settings);

} // namespace ise::instantiation
