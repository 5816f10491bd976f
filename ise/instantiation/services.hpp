#pragma once
#include <ise/component/type_info.hpp>
#include <ise/core/time.hpp>
#include <ise/instantiation/limits.hpp>
#include <ise/session/contract.hpp>

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

/// The packets and contracts of the instantiation server, of which each host has one. They meet other versions of
/// themselves: fields are only ever appended.
namespace ise::instantiation {

/// Below it each host's instantiation server is found under the host's name: "ise/host/shore".
inline constexpr std::string_view hosts_path = "ise/host";

// --- what can be started ------------------------------------------------------------------------------------------

struct types_request {};

struct catalogue_type {
    std::string program; ///< the file that has it
    type_info about;
    bool shares_process = false; ///< components of that program may run in one process
};

struct types_response {
    std::vector<catalogue_type> types;
    std::vector<std::string> problems; ///< programs of the catalogue that cannot be used, and why
};

// --- what runs ----------------------------------------------------------------------------------------------------

enum class restart_policy : std::uint8_t {
    never,
    on_failure, ///< when it ended with another exit code than 0, or by a signal
    always,     ///< whenever it ended without having been asked to
};

/// How an instance is watched over. The pause before a restart doubles from the first to the longest, with jitter.
struct restart_terms {
    restart_policy policy = restart_policy::never;
    duration first_pause = std::chrono::milliseconds(500);
    duration max_pause = std::chrono::seconds(30);
    std::uint32_t limit = 5; ///< restarts within the window; one more, and it has failed
    duration window = std::chrono::minutes(1);
    duration grace = std::chrono::seconds(5); ///< between SIGTERM and SIGKILL
    duration ready_within = std::chrono::seconds(10);
    std::string
        probe; ///< "tcp://127.0.0.1:8080" or "http://127.0.0.1:8080/": has to answer while it is ready; empty: none
    duration probe_every = std::chrono::seconds(10);
    std::uint32_t probe_failures = 3; ///< so many on end, and it is started again by its policy

    bool operator==(const restart_terms&) const = default;
};

struct argument {
    std::string name;
    std::string value;
};

struct start_request {
    std::string type;
    std::string path;                ///< empty: the one that the type has
    std::string name_space;          ///< put before the path: "atirma" and "boat" are "atirma/boat"
    std::vector<argument> arguments; ///< parameters of the type
    std::vector<std::string> listen; ///< endpoints; none: what its node chooses
    std::string protocol; ///< such as "tcp": any endpoint of a scheme that reaches other processes; else `listen`
    std::vector<argument> variables; ///< environment variables that the type declares
    restart_terms terms;
    std::map<std::string, std::int32_t> roles; ///< that it serves beside its name, with its priority there
    std::string deployment;                    ///< of whose file it is a part; empty: of none
    /// Name of a process that it shares with others of its program, each on a thread of its own; empty: it has one to
    /// itself.
    std::string process;
    resource_limits limits; ///< of its process, with all that it starts; the defaults where it shares one
    std::string identity;   ///< certificates of its own, by the name of their folder there; empty: those of the server
    std::string user;       ///< of the operating system, that it runs as; empty: that of the server
};

enum class instance_state : std::uint8_t {
    starting, ///< it runs, but is not found or does not answer yet
    ready,
    stopping, ///< it was asked to end
    waiting,  ///< it ended, and is started again after a pause
    stopped,  ///< as asked, or by itself and well
    failed,   ///< and is not started again: `reason` says why
};

/// An instance, as it is now.
struct instance_info {
    std::string path;
    std::string type;
    std::string program;
    instance_state state = instance_state::starting;
    std::string reason;          ///< of its last state change
    std::int32_t process_id = 0; ///< 0: none runs
    wall_time since{};           ///< of the state
    std::uint32_t restarts = 0;
    bool adopted = false; ///< an instantiation server that ran before had started it
    restart_terms terms;
    std::vector<argument> arguments;
    std::vector<std::string> listen; ///< as it was asked for
    std::string protocol;
    std::vector<argument> variables; ///< by name: their values may be secrets, and stay with the instantiation server
    std::map<std::string, std::int32_t> roles;
    std::string deployment;
    std::string process; ///< that it shares with others; empty: it has one to itself
    resource_limits limits;
    std::uint64_t output_dropped = 0; ///< bytes that it printed and that could not be written
    std::string output_trouble;       ///< why they still cannot; empty: they can
    std::string probe_trouble;        ///< why its health probe fails; empty: it does not, or there is none
    bool rebuilt = false;             ///< its program's file is another since it was started; told by `instances` only
    std::string identity;             ///< as it was asked for; empty: that of the instantiation server
    std::string user;                 ///< the same
};

enum class start_outcome : std::uint8_t {
    ready, ///< it runs, has registered and answers
    no_such_type,
    bad_argument, ///< a parameter, path, endpoint, variable or term: `why` says which, and what is allowed
    name_taken,
    address_in_use,
    too_many,         ///< instances, or starts within a short time
    name_server_lost, ///< it could not be known whether it is ready
    not_launched,     ///< the program could not be started
    exited,           ///< before it was ready
    deadline,         ///< it was not ready in time, and was ended
};

struct start_response {
    start_outcome outcome = start_outcome::ready;
    std::string why;        ///< unless it is ready
    std::string output;     ///< the last lines that it printed, where it was launched and did not become ready
    instance_info started;  ///< as it is now; without a path where nothing came of it
    duration retry_after{}; ///< `too_many`: when there is room for another start; 0: waiting does not help
};

struct instances_request {
    std::string prefix; ///< that path and all below it; empty: all
};

struct instances_response {
    std::vector<instance_info> instances; ///< by path
};

struct stop_request {
    std::string path;
    std::optional<duration> grace; ///< else the instance's own
    bool forget = false;           ///< then nothing is kept of it: neither what it printed nor that it was
};

struct kill_request {
    std::string path;
};

struct restart_request {
    std::string path;
};

struct ended_response {
    instance_info ended;
};

/// What an instance is to be from now on: as in a request to start it. Its path is found by the same rules.
struct change_request {
    start_request to;
    std::uint64_t undo = 0; ///< of a change_response: back to what it was before that change, with `to.path` only
};

enum class change_way : std::uint8_t {
    nothing,   ///< it was so already
    in_place,  ///< it runs on
    restarted, ///< or was started, where it did not run
};

struct set_request {
    std::string path;
    std::vector<argument> settings;
};

struct set_response {
    instance_info instance;
};

struct change_response {
    change_way way = change_way::nothing;
    /// Where that is not `ready`, nothing has changed: it runs as before, unless `started` says otherwise.
    start_response outcome;
    start_request former;   ///< what it was before, without the values of its environment variables
    std::uint64_t undo = 0; ///< undoes this change as long as no other follows; 0: nothing was changed
};

// --- what would become of a start ----------------------------------------------------------------------------------

/// What is wanted on this host, all of it: no two may need the same endpoint.
struct checks_request {
    std::vector<start_request> wanted;
};

struct checked_start {
    start_outcome outcome = start_outcome::ready; ///< nothing is against it, as far as it can be known before
    std::string why;                              ///< unless it is ready
    bool other_environment = false;               ///< an instance of that path runs with other environment variables
};

struct checks_response {
    std::vector<checked_start> checked; ///< of each that is wanted
};

// --- what it prints -----------------------------------------------------------------------------------------------

struct output_request {
    std::string path;
    std::uint32_t max_bytes = 64 << 10; ///< of the end
};

/// A part of what an instance has printed, to either of its streams.
struct output_piece {
    std::string path;
    std::uint64_t offset = 0; ///< bytes before it, since the instantiation server or the instance was started
    std::string text;
};

struct follow_request {
    std::string path;
};

// --- what happens -------------------------------------------------------------------------------------------------

struct host_event {
    wall_time at{};
    instance_info instance;
};

// --- the services -------------------------------------------------------------------------------------------------

namespace services {

inline constexpr request_response<types_request, types_response> types{"ise.host.types"};
/// Completes when the component is ready: registered and answering. Else it does not run any more, and the outcome says
/// why. A caller that gives up ends what it began.
inline constexpr request_response<start_request, start_response> start{"ise.host.start"};
/// Those that the caller may read, by the access policy; so also `events`.
inline constexpr request_response<instances_request, instances_response> instances{"ise.host.instances"};
/// SIGTERM to the whole process group, SIGKILL after the grace; completes when nothing of it runs.
/// errc::refused names the instances that there are; also of the services below.
inline constexpr request_response<stop_request, ended_response> stop{"ise.host.stop"};
/// The same at once by SIGKILL. It is not started again. A component that shares a process is stopped; where it does
/// not end at once, nor within the grace of a stop, its process is killed with all that runs in it.
inline constexpr request_response<kill_request, ended_response> kill{"ise.host.kill"};
/// Stops it if it runs and starts it with the same arguments; completes and fails as `start` does. It goes on where its
/// caller gives up.
inline constexpr request_response<restart_request, start_response> restart{"ise.host.restart"};
/// Changes what runs: parameters that may change while it runs in place, for others it is started again. What it
/// becomes holds from then on, also after a restart by its terms. A caller that gives up before it is ready undoes the
/// change. errc::refused as above, and where it is being changed already.
inline constexpr request_response<change_request, change_response> change{"ise.host.change"};
/// Whether components could be started or changed so: types, parameters, addresses, hosts and folders that are allowed,
/// names that others hold, ports in use (but those of instances of the same deployment, and what runs under the same
/// path). Starts nothing. errc::overloaded: more than 256 are wanted, or environment variables are compared too often.
inline constexpr request_response<checks_request, checks_response> check{"ise.host.check"};
/// Sets parameters that may be changed while it runs, and nothing else; they hold after a restart too.
/// errc::refused also: no such parameter or value, one that takes a restart, or the component has something against
/// it.
inline constexpr request_response<set_request, set_response> set{"ise.host.set"};
/// errc::access_denied: the access policy does not let the caller read that component; so also `output`.
inline constexpr request_response<output_request, output_piece> last_output{"ise.host.output"};
inline constexpr subscription<output_piece, follow_request> output{"ise.host.output_follow"};
inline constexpr subscription<host_event> events{"ise.host.events"};

} // namespace services

} // namespace ise::instantiation
