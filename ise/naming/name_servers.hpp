#pragma once
#include <ise/core/endpoint.hpp>
#include <ise/core/environment.hpp>
#include <ise/core/result.hpp>
#include <ise/service/resolver.hpp> // text_of

#include <string>
#include <string_view>
#include <vector>

namespace ise {

/// The most name servers of one list.
inline constexpr std::size_t max_name_servers = 16;

/// "tcp://a:7400,tcp://b:7400": name servers that share a store, in the order in which clients try them. Errors:
/// errc::invalid_argument for an empty list, more than `max_name_servers` or what is no endpoint.
result<std::vector<endpoint>> parse_name_servers(std::string_view text);
/// Those of the environment variable ISE_NAME_SERVER, else `default_name_server()`. Errors: as `parse_name_servers`.
result<std::vector<endpoint>> usual_name_servers(const environment& env);

} // namespace ise
