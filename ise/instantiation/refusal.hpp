#pragma once
#include <ise/core/error.hpp>
#include <ise/instantiation/services.hpp>

namespace ise::instantiation {

/// Why nothing came of a request to start something, as its answer.
start_response refusal(const error& why);

/// The terms themselves where they are within their bounds. Throws errc::invalid_argument with what is allowed.
restart_terms checked(restart_terms terms);

} // namespace ise::instantiation
