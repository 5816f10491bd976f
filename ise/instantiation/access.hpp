#pragma once
#include <ise/access/policy.hpp>
#include <ise/instantiation/server_context.hpp>
#include <ise/instantiation/services.hpp>
#include <ise/subscription/subscriber_group.hpp>

#include <cstdint>
#include <map>
#include <optional>
#include <string>

namespace ise::instantiation {

/// Throws errc::access_denied where the access policy does not let `by` start or stop that here; either is a line of
/// the audit log. `type`: empty where it is not known.
void check_access(server_context& here, const verified_peer* by, access::action what, const std::string& path,
                  const std::string& type);
/// The same of a start as the request has it: its type, identity and user.
void check_start(server_context& here, const verified_peer* by, const std::string& path, const start_request& request);
/// Throws errc::access_denied where `by` may not give a component these roles with these priorities.
void check_roles(server_context& here, const verified_peer* by, const std::map<std::string, std::int32_t>& roles);
/// The same for a parameter of a component.
void check_setting(server_context& here, const verified_peer* by, const std::string& path,
                   const std::string& parameter);
/// The access policy's objection to `by` reading state and output of the component at that path. With `keep` a refusal
/// is written to the audit log.
std::optional<failure> objection_to_read(server_context& here, const verified_peer* by, const std::string& path,
                                         bool keep);
/// A subscriber as a peer for the access policy; one in this process is judged by its identity.
verified_peer peer_of(const subscriber_info& who);

} // namespace ise::instantiation
