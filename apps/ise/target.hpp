#pragma once
#include "command.hpp"

#include <ise/component/discover.hpp>
#include <ise/naming/services.hpp>
#include <ise/service/resolver.hpp>

#include <string>
#include <vector>

namespace ise::cli {

/// problem(usage) unless it can be a component's path, or a role's: nothing else is looked up.
void check_name(const std::string& name);
/// The same of a PREFIX, which may be empty or end in a slash.
void check_prefix(const std::string& prefix);

/// Says on standard error that nothing is registered under it, with the nearest of `known`.
void note_nothing(const context& in, const std::string& prefix, const std::vector<std::string>& known = {});

/// The name server, reached; problem(not_reached) says how to start one.
task<remote> reach_name_server(context& in);

/// What the name server knows under a prefix, by path.
task<std::vector<naming::listed_name>> listed_names(context& in, std::string prefix);

/// The component of that path or endpoint, with a session to it. Unless `--wait` was given the first failure to reach
/// it is the last: problem(not_reached) with the nearest names that there are.
task<remote> reach(context& in, std::string name);

/// Who is found under a path that was reached; nobody under an endpoint.
task<resolution> members_of(context& in, std::string name);

/// What it tells about itself.
task<component_info> ask_about(context& in, remote who);

/// One of its services; problem(not_reached) with those that there are, problem(usage) naming the right command if it
/// is of the other kind.
service_kind kind_of(const service_info& one);
/// "request-response", "subscription" or "action", which is a subscription and means more to people.
std::string_view kind_name(const dynamic_contract& service);
/// The same; of one whose packets cannot be read, that of the service.
std::string_view kind_name(const service_info& one);
task<dynamic_contract> find_service(context& in, remote who, std::string service, service_kind wanted);

/// A call's request; problem(usage) if it has fields and none was given: defaults by surprise could start a motor.
task<dynamic_packet> request_from(context& in, const dynamic_contract& service, std::string name, std::string json);

/// JSON as a packet: problem(mismatch) with the path of what is wrong, and the packet's schema. Read on another thread:
/// a long text must not silence the heartbeats.
task<dynamic_packet> packet_from(context& in, schema of, std::string json, std::string what);

/// A line that a shell takes: how to call the service of `name`, or subscribe to it, with every field at its default.
std::string example(const std::string& name, const dynamic_contract& service);

/// ISE's own services, which nobody called for.
inline bool is_own_service(std::string_view service) { return service.starts_with("ise."); }

} // namespace ise::cli
