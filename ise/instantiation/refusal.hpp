#pragma once
#include <ise/core/error.hpp>
#include <ise/instantiation/catalogue.hpp>
#include <ise/instantiation/services.hpp>

namespace ise::instantiation {

/// Why nothing came of a request to start something, as its answer.
start_response refusal(const error& why);

/// Whether terms, probe, limits and the name of the deployment are within their bounds. Throws errc::invalid_argument
/// with what is allowed.
void check_wishes(const start_request& request, const launch_rules& rules);

} // namespace ise::instantiation
