#pragma once
#include <ise/core/endpoint.hpp>
#include <ise/core/time.hpp>
#include <ise/session/contract.hpp>

#include <algorithm>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <tuple>
#include <vector>

namespace ise {

/// Where the name server is unless ISE_NAME_SERVER says otherwise.
inline endpoint default_name_server() { return endpoint{protocol::tcp, "127.0.0.1", 7400, {}}; }

} // namespace ise

/// The packets and contracts of the name service. They live for long and meet other versions of themselves: fields are
/// only ever appended.
namespace ise::naming {

/// The path of the name server itself.
inline constexpr std::string_view server_path = "ise/name_server";

// --- what a node tells --------------------------------------------------------------------------------------------

/// A node's process, and the key of its lease.
struct node_identity {
    std::uint64_t lease_key = 0; ///< random and secret: its knowledge permits renewing and withdrawing
    std::string name;            ///< for people
    /// For people.
    std::string host_name;
    std::string host_key;    ///< equal where local sockets and loopback reach
    std::string process_key; ///< equal within one process and life
    /// On its host.
    std::uint64_t process_id = 0;
    /// Of a process that an instantiation server started, as in `ended_request`; secret.
    std::string launch_mark;
};

/// The canonical text of a packet's schema.
struct schema_text {
    std::uint64_t fingerprint = 0; ///< of the schema
    std::string text;              ///< one line
};

/// A service that a component provides or needs.
struct service_entry {
    /// Unique within the component and its direction.
    std::string name;
    std::uint8_t kind = 0;                   ///< ise::service_kind
    bool provided = true;                    ///< else required of others
    std::vector<std::uint64_t> fingerprints; ///< of its packets, in the order of its kind
};

/// A component that wants its name, or has it.
struct component_claim {
    /// Wanted or held.
    std::string path;
    std::uint64_t incarnation = 0;      ///< one life of the component
    std::uint64_t epoch = 0;            ///< as it was granted before; 0: never
    std::string type;                   ///< for people
    std::string state;                  ///< "ready", "stalled"…
    std::vector<std::string> endpoints; ///< as ise::endpoint::text() writes them
    /// Provided and required.
    std::vector<service_entry> services;
    std::map<std::string, std::int32_t> roles; ///< that it serves beside its own name: path and priority
    std::uint64_t proof = 0;                   ///< as it was granted with `epoch`
    std::string waits_for;                     ///< for people; empty: nothing, or not for long
};

/// Claims names, or reports changes of claims; renews the node's lease too.
struct register_request {
    node_identity node;                      ///< the claimant
    duration lease{};                        ///< wanted
    std::vector<component_claim> components; ///< new ones, and those of which something has changed
    std::vector<schema_text> schemas;        ///< of the packets that the services name
};

/// The decision on a claim.
enum class verdict : std::uint8_t {
    granted,    ///< the claimant holds the path, under the epoch of the answer
    taken,      ///< another holds it
    superseded, ///< another was granted it later than the claimant
    wait,    ///< not now: the server has restarted and waits for those who held names before, or has no room; ask again
    refused, ///< no such claim can be granted, whatever is registered: the reason says why
};

/// The holder of a path.
struct holder {
    /// Granted.
    std::uint64_t epoch = 0;
    /// Of this life of it.
    std::uint64_t incarnation = 0;
    /// For people.
    std::string host_name;
    /// On that host.
    std::uint64_t process_id = 0;
    std::string endpoint;       ///< the first
    duration lease_age{};       ///< since it was last renewed
    std::uint64_t renewals = 0; ///< of its lease so far
};

/// The answer to one claim.
struct grant {
    /// Claimed.
    std::string path;
    verdict what = verdict::granted; ///< which of the fields below count
    std::uint64_t epoch = 0;         ///< granted
    std::string reason;              ///< where it was not granted
    std::vector<holder> held_by;     ///< taken, superseded: one
    duration retry_after{};          ///< wait
    std::uint64_t proof = 0;         ///< granted: proves the grant to the server, also after its restart; secret
};

/// The answer to `register_request`.
struct register_response {
    /// Another one than before: the server was restarted.
    std::uint64_t server_incarnation = 0;
    duration lease{};          ///< granted; at most what was wanted. 0: none, as every claim was denied
    std::vector<grant> grants; ///< in the order of the claims
    /// Of the lease in this life of the server. A new number: the server has lost what was reported before.
    std::uint64_t lease_number = 0;
};

/// Renews a lease, and nothing else.
struct renew_request {
    /// As it was registered with.
    std::uint64_t lease_key = 0;
};

/// The answer to `renew_request`.
struct renew_response {
    bool known = false; ///< false: the server does not know the lease (any more): register again
    /// Another one than before: the server was restarted.
    std::uint64_t server_incarnation = 0;
    /// Granted, from now on.
    duration lease{};
    std::vector<grant> lost;        ///< names granted to others; repeated until they are withdrawn
    std::uint64_t lease_number = 0; ///< as in register_response
};

/// A component that leaves.
struct departure {
    /// Held until now.
    std::string path;
    std::uint64_t incarnation = 0; ///< a later life of the component is not meant
};

/// Gives names back.
struct withdraw_request {
    /// As they were registered with.
    std::uint64_t lease_key = 0;
    std::vector<departure> departures; ///< of that lease
};

/// Withdrawing always succeeds.
struct withdraw_response {};

/// A process has died. Only the program that started it can report this: it alone knows the mark that it gave the
/// process.
struct ended_request {
    /// Random, of `min_mark_bytes` at least; in the environment of the process, as `launch_mark_variable`.
    std::string launch_mark;
};

/// The names of the process are free.
struct ended_response {
    std::uint32_t nodes = 0; ///< whose leases were ended
};

// --- what others ask ----------------------------------------------------------------------------------------------

/// Requests the holder of a name.
struct resolve_request {
    /// Exactly.
    std::string path;
};

/// A component that serves a role.
struct role_member {
    std::string path;                   ///< held
    std::int32_t priority = 0;          ///< the highest is preferred
    std::string state;                  ///< "ready", "stalled"…
    std::uint64_t epoch = 0;            ///< granted
    std::uint64_t incarnation = 0;      ///< of this life
    std::string host_name;              ///< for people
    std::string host_key;               ///< equal where local sockets and loopback reach
    std::string process_key;            ///< equal within one process and life
    std::vector<std::string> endpoints; ///< as ise::endpoint::text() writes them
};
/// The answer to `resolve_request`.
struct resolve_response {
    std::string path;                   ///< held
    std::uint64_t epoch = 0;            ///< this and what follows of the holder, or of the best member
    std::uint64_t incarnation = 0;      ///< of this life
    std::string host_name;              ///< for people
    std::string host_key;               ///< equal where local sockets and loopback reach
    std::string process_key;            ///< equal within one process and life
    std::vector<std::string> endpoints; ///< as ise::endpoint::text() writes them
    std::vector<role_member> members;   ///< of a role: all, best first; of a name none
    bool certain = true;                ///< false: the server has just restarted, and may not know every member yet
};
/// Asks for the members of a role.
struct role_request {
    std::string role; ///< its path
};

/// The present members of a role, best first.
struct role_members {
    std::string role;                 ///< its path
    std::vector<role_member> members; ///< best first
    bool certain = true;              ///< false: the server has just restarted, and there may be more
};
/// Requests the holder of a name, and waits until there is one.
struct await_request {
    /// Exactly.
    std::string path;
    duration wait{};              ///< for somebody to hold it, at most `max_wait`
    std::uint64_t other_than = 0; ///< an incarnation to ignore: the caller knows that it is gone
};

/// The answer to `await_request`.
struct await_response {
    std::optional<resolve_response> found; ///< nothing: nobody held it within the wait
    bool certain = true;                   ///< false: the server has just restarted, and may not know the holder yet
};

/// A name as lists and watchers see it.
struct listed_name {
    std::string path;                          ///< held
    std::uint64_t epoch = 0;                   ///< granted
    std::uint64_t incarnation = 0;             ///< of this life
    std::string type;                          ///< for people
    std::string state;                         ///< "ready", "stalled"…
    std::string node;                          ///< its name, for people
    std::string host_name;                     ///< for people
    std::uint64_t process_id = 0;              ///< on that host
    std::vector<std::string> endpoints;        ///< as ise::endpoint::text() writes them
    std::uint32_t services_provided = 0;       ///< how many
    duration lease_age{};                      ///< in lists: since it was last renewed, where it is kept
    std::map<std::string, std::int32_t> roles; ///< that it serves, with its priority
    std::string waits_for;                     ///< for people; empty: nothing, or not for long
};

/// Asks for names in order.
struct list_request {
    std::string prefix;      ///< "atirma/shore" is that path and all below it; empty: every name
    std::string after;       ///< goes on behind this path
    std::uint32_t limit = 0; ///< at most so many; 0: as many as the server gives at once
};

/// The answer to `list_request`.
struct list_response {
    std::vector<listed_name> names; ///< by path
    bool more = false;              ///< ask again, after the last path here
    std::string trouble; ///< for people: why the names are unconfirmed and none is granted; empty: nothing is known
};

/// Asks for all of a component.
struct describe_request {
    /// Exactly.
    std::string path;
};

/// The answer to `describe_request`.
struct describe_response {
    /// As in lists.
    listed_name name;
    /// Provided and required.
    std::vector<service_entry> services;
    std::vector<schema_text> schemas; ///< those that `services` name, if they were reported
    /// Of its node; 0: another name server keeps it.
    duration lease{};
    duration lease_age{}; ///< since it was last renewed
};

/// Asks for names that were lost.
struct lost_request {
    std::string prefix; ///< as in list_request
};

/// A name whose lease expired: its holder neither released it nor was reported dead, and no other holder followed.
struct lost_name {
    std::string path;             ///< held until then
    std::string host_name;        ///< of the holder, for people
    std::uint64_t process_id = 0; ///< on that host
    duration lost_ago{};          ///< since the lease ran out
};

/// The answer to `lost_request`.
struct lost_response {
    std::vector<lost_name> names; ///< by path; at most as many as the server gives at once
};

/// Subscribes to changes of names.
struct watch_request {
    std::string prefix; ///< as in list_request
};

/// What has become of a name.
enum class name_change : std::uint8_t { added, changed, removed };

/// A name that has changed.
struct name_event {
    name_change what = name_change::added; ///< has happened
    /// As it is now, or was.
    listed_name name;
};

/// What has changed under a watched prefix. The first packet is a snapshot, and so is the first after the server was
/// restarted: it replaces all earlier knowledge. A subscriber that loses a packet (`lost_before()`) subscribes anew.
struct name_events {
    bool snapshot = false;          ///< the events are all names that there are
    std::vector<name_event> events; ///< in order
};

// --- the services of the name server ------------------------------------------------------------------------------

/// Claims names; renews the lease.
inline constexpr request_response<register_request, register_response> enroll{"ise.names.register"};
/// Renews a lease.
inline constexpr request_response<renew_request, renew_response> renew{"ise.names.renew"};
/// Gives names back at once.
inline constexpr request_response<withdraw_request, withdraw_response> withdraw{"ise.names.withdraw"};
/// Ends the leases of a process that has died, before they run out. errc::refused: no mark that a process is started
/// with.
inline constexpr request_response<ended_request, ended_response> ended{"ise.names.ended"};
/// The holder of a name, or if there is none the members of a role. errc::no_such_name: neither exists;
/// errc::name_server_lost: the server has just restarted and cannot say.
inline constexpr request_response<resolve_request, resolve_response> resolve{"ise.names.resolve"};
/// Answers when there is a holder, or without one after the wait.
inline constexpr request_response<await_request, await_response> wait_for{"ise.names.await"};
/// Lists names, in pages.
inline constexpr request_response<list_request, list_response> list{"ise.names.list"};
/// All that is known of a name.
inline constexpr request_response<describe_request, describe_response> describe{"ise.names.describe"};
/// Names whose holders were lost since the server was started. errc::no_such_service: an older server.
inline constexpr request_response<lost_request, lost_response> lost{"ise.names.lost"};
/// Tells of changes.
inline constexpr subscription<name_events, watch_request> watch{"ise.names.watch"};

/// The first packet has the present members, the next ones follow every change; each replaces the previous one.
inline constexpr subscription<role_members, role_request> role_changes{"ise.names.role"};

/// The variable that carries the mark of a process, through all that it starts.
inline constexpr const char* launch_mark_variable = "ISE_INSTANCE";
/// A shorter one is no secret.
inline constexpr std::size_t min_mark_bytes = 32;

inline constexpr duration max_wait = std::chrono::seconds(10); ///< of `wait_for`

/// The order in which the members of a role are preferred, smaller first: those that are ready, by priority, then who
/// was granted its name earlier.
inline std::tuple<bool, std::int64_t, std::uint64_t> role_rank(std::string_view state, std::int32_t priority,
                                                               std::uint64_t epoch) noexcept {
    return {state != "ready", -std::int64_t{priority}, epoch};
}

/// Of a component, in bytes.
inline constexpr std::size_t max_path = 200;

/// Whether it is written like the path of a component or a role, `atirma/shore/xbee`; of any length.
inline bool is_path(std::string_view path) noexcept {
    auto fits = [](unsigned char letter) {
        return (letter >= 'a' && letter <= 'z') || (letter >= 'A' && letter <= 'Z') ||
               (letter >= '0' && letter <= '9') || letter == '_' || letter == '-' || letter == '.' || letter == '/';
    };
    return !path.empty() && std::ranges::all_of(path, fits) && !path.starts_with('/') && !path.ends_with('/') &&
           path.find("//") == path.npos;
}

/// Whether `path` is `prefix` or lies below it; every path lies below an empty one.
inline bool lies_below(std::string_view path, std::string_view prefix) noexcept {
    while (prefix.ends_with('/')) prefix.remove_suffix(1);
    return prefix.empty() || (path.starts_with(prefix) && (path.size() == prefix.size() || path[prefix.size()] == '/'));
}

} // namespace ise::naming
