#pragma once
#include <ise/core/environment.hpp>
#include <ise/core/result.hpp>
#include <ise/wire/messages.hpp>

#include <optional>
#include <vector>

namespace ise::net {

/// Why a session that proved the shared key was not dialled to `reached`, where it came in: somebody between the two
/// passes on what they say, and could speak for either after the handshake. Nothing: it was, or to an endpoint in
/// `advertised`, or the hello does not say (an earlier version), or nobody between could use it (tls, in-process).
/// FORMAT.md, section 5.
std::optional<failure> objection_to_way(const wire::hello& caller, const endpoint& reached,
                                        const std::vector<endpoint>& advertised, const environment& env);

} // namespace ise::net
