#pragma once
#include "conversation.hpp"
#include "names.hpp"

#include <ise/component/discover.hpp>
#include <ise/naming/services.hpp>
#include <ise/service/resolver.hpp>

#include <string>
#include <vector>

namespace ise::cli {

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
task<dynamic_contract> find_service(context& in, remote who, std::string service, service_kind wanted);

/// JSON as a packet: problem(mismatch) with the path of what is wrong, and the packet's schema. Read on another thread:
/// a long text must not silence the heartbeats.
task<dynamic_packet> packet_from(context& in, schema of, std::string json, std::string what);

/// ISE's own services, which nobody called for.
inline bool is_internal(std::string_view service) { return service.starts_with("ise."); }

} // namespace ise::cli
