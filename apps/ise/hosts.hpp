#pragma once
#include "target.hpp"

#include <ise/instantiation/services.hpp>

#include <string>
#include <vector>

namespace ise::cli {

/// A host's instantiation server.
struct host_server {
    std::string name; ///< "shore"
    remote server;
};

/// Those that are registered, or the one of that name. problem(not_reached) says how to start one, or which there are.
task<std::vector<host_server>> hosts_there(context& in, std::string name);
/// The one to start something on: the only one, or this machine's; problem(usage) if that is not clear.
task<host_server> host_to_use(context& in, std::string name);

struct found_instance {
    host_server host;
    instantiation::instance_info instance;
};
/// What all hosts have started, by host and path. A host that does not answer is told in a note.
task<std::vector<found_instance>> instances_there(context& in, std::string host, std::string prefix);
/// One of them; problem(not_reached) with the nearest that there are, problem(usage) if several hosts have it.
task<found_instance> find_instance(context& in, std::string host, std::string path);

/// The instance that was started; a problem that tells why not, with its last output.
instantiation::instance_info started(const instantiation::start_response& told);

/// One line of JSON, without its end.
std::string as_json(const std::string& host, const instantiation::instance_info& what);
std::string_view name_of(instantiation::instance_state state);
/// "atirma/boat is ready on shore, as process 4711"
std::string as_sentence(const std::string& host, const instantiation::instance_info& what);

} // namespace ise::cli
