#pragma once
#include <ise/core/error.hpp>
#include <ise/instantiation/catalogue.hpp>
#include <ise/instantiation/services.hpp>

#include <string>

namespace ise::instantiation {

/// Why nothing came of a request to start something, as its answer.
start_response refusal(const error& why);

/// Why a component may not have the identity and the user of its own that a request names; empty: it may.
std::string objection_to_own(const start_request& request, const launch_rules& rules);

/// Whether terms, limits and the name of the deployment are within their bounds. Throws errc::invalid_argument with
/// what is allowed.
void check_wishes(const start_request& request, const launch_rules& rules);

} // namespace ise::instantiation
