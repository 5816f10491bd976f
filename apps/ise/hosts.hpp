#pragma once
#include "target.hpp"

#include <ise/instantiation/services.hpp>

#include <chrono>
#include <map>
#include <string>
#include <string_view>
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
/// The instances below a prefix that a host has started, or the failure if it does not answer within 3 s.
task<result<std::vector<instantiation::instance_info>>> instances_of(context& in, host_server of, std::string prefix);
/// Instantiation servers that were lost without being stopped, as far as the name server knows.
task<std::vector<naming::lost_name>> lost_hosts(context& in);
/// What all hosts have started, by host and path. A host that does not answer is told in a note.
task<std::vector<found_instance>> instances_there(context& in, std::string host, std::string prefix);
/// One of them; problem(not_reached) with the nearest that there are, problem(usage) if several hosts have it.
task<found_instance> find_instance(context& in, std::string host, std::string path);

/// The instance that was started; a problem that tells why not, with its last output.
instantiation::instance_info started(const instantiation::start_response& result);

/// What `--json` prints of an instance.
struct instance_line {
    std::string host, path, type, program;
    std::string_view state;
    std::string reason;
    std::int32_t process_id = 0;
    std::string process;
    std::chrono::duration<double> since_s{};
    std::uint32_t restarts = 0;
    bool adopted = false;
    std::vector<instantiation::argument> arguments;
    std::map<std::string, std::int32_t> roles;
    std::string deployment;
    instantiation::resource_limits limits;
    std::uint64_t output_dropped = 0;
    std::string output_trouble, probe, probe_trouble;
    bool rebuilt = false;
    std::string identity, user;
};
instance_line line_of(const std::string& host, const instantiation::instance_info& what);
std::string_view name_of(instantiation::instance_state state);
/// Prints it: "atirma/boat is ready on shore, as process 4711", or with --json its line.
task<> print_instance(context& in, std::string host, instantiation::instance_info what);

/// The option `--host` of commands about an instance.
void add_host(command_line::app& app, std::string& host);

/// Beside what a component may take by its own terms: a name that has to come free, and the way there and back.
inline constexpr duration besides_own_terms = std::chrono::seconds(15);

} // namespace ise::cli
