#pragma once
#include <ise/core/endpoint.hpp>
#include <ise/core/environment.hpp>
#include <ise/core/result.hpp>

#include <optional>

namespace ise {

/// Where the name server is for a program: at `given`, else at ISE_NAME_SERVER, else where it is by default. An empty
/// variable counts as none. errc::invalid_argument: the variable is no endpoint.
result<endpoint> name_server_for(const environment& env, const std::optional<endpoint>& given = {});

} // namespace ise
