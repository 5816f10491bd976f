#pragma once
#include <ise/core/endpoint.hpp>
#include <ise/core/time.hpp>
#include <ise/service/contract.hpp>

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
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
    std::uint64_t lease_key = 0; ///< random; whoever knows it may renew and withdraw. Told to nobody else
    std::string name;            ///< for people
    std::string host_name;
    std::string host_key;        ///< equal where local sockets and loopback reach
    std::string process_key;     ///< equal within one process and life
    std::uint64_t process_id = 0;
};

/// The canonical text of a packet's schema.
struct schema_text {
    std::uint64_t fingerprint = 0;
    std::string text;
};

struct service_entry {
    std::string name;
    std::uint8_t kind = 0;                   ///< ise::service_kind
    bool provided = true;                    ///< else required of others
    std::vector<std::uint64_t> fingerprints; ///< of its packets, in the order of its kind
};

/// A component that wants its name, or has it.
struct component_claim {
    std::string path;
    std::uint64_t incarnation = 0;      ///< one life of the component
    std::uint64_t epoch = 0;            ///< as it was granted before; 0: never
    std::string type;                   ///< for people
    std::string state;                  ///< "ready", "stalled"…
    std::vector<std::string> endpoints; ///< as ise::endpoint::text() writes them
    std::vector<service_entry> services;
};

/// Claims names, or tells what has changed of them; renews the node's lease too.
struct register_request {
    node_identity node;
    duration lease{};                  ///< wanted
    std::vector<component_claim> components;
    std::vector<schema_text> schemas;  ///< of the packets that the services name
};

enum class verdict : std::uint8_t {
    granted,    ///< the path is the claimant's, under the epoch that is told
    taken,      ///< another holds it
    superseded, ///< another was granted it later than the claimant
    wait,       ///< not now: the server has restarted and waits for those who held names before
    refused,    ///< no such claim can be granted: the reason says why
};

/// Who has a path.
struct holder {
    std::uint64_t epoch = 0;
    std::uint64_t incarnation = 0;
    std::string host_name;
    std::uint64_t process_id = 0;
    std::string endpoint;  ///< the first
    duration lease_age{};  ///< since it was last renewed
    std::uint64_t renewals = 0; ///< of its lease so far
};

struct grant {
    std::string path;
    verdict what = verdict::granted;
    std::uint64_t epoch = 0;      ///< granted
    std::string reason;           ///< where it was not granted
    std::vector<holder> held_by;  ///< taken, superseded: one
    duration retry_after{};       ///< wait
};

struct register_response {
    std::uint64_t server_incarnation = 0;
    duration lease{};           ///< granted; at most what was wanted
    std::vector<grant> grants;  ///< in the order of the claims
};

struct renew_request {
    std::uint64_t lease_key = 0;
};

struct renew_response {
    bool known = false;        ///< false: the server does not know the lease (any more): register again
    std::uint64_t server_incarnation = 0;
    duration lease{};
    std::vector<grant> lost;   ///< names that went to others; told until they are withdrawn
};

struct departure {
    std::string path;
    std::uint64_t incarnation = 0; ///< a later life of the component is not meant
};

struct withdraw_request {
    std::uint64_t lease_key = 0;
    std::vector<departure> departures;
};

struct withdraw_response {};

// --- what others ask ----------------------------------------------------------------------------------------------

struct resolve_request {
    std::string path;
};

struct resolve_response {
    std::string path;
    std::uint64_t epoch = 0;
    std::uint64_t incarnation = 0;
    std::string host_name;
    std::string host_key;
    std::string process_key;
    std::vector<std::string> endpoints;
};

struct await_request {
    std::string path;
    duration wait{}; ///< for somebody to hold it, at most `longest_wait`
};

struct await_response {
    std::optional<resolve_response> found;
    bool certain = true; ///< false: the server has just restarted, and may not know yet who holds the name
};

/// A name as lists and watchers see it.
struct listed_name {
    std::string path;
    std::uint64_t epoch = 0;
    std::uint64_t incarnation = 0;
    std::string type;
    std::string state;
    std::string node;
    std::string host_name;
    std::uint64_t process_id = 0;
    std::vector<std::string> endpoints;
    std::uint32_t services_provided = 0;
    duration lease_age{};  ///< in lists: since it was last renewed
};

struct list_request {
    std::string prefix;       ///< "atirma/shore" is that path and all below it; empty: every name
    std::string after;        ///< goes on behind this path
    std::uint32_t limit = 0;  ///< at most so many; 0: as many as the server gives at once
};

struct list_response {
    std::vector<listed_name> names; ///< by path
    bool more = false;              ///< ask again, after the last path here
};

struct describe_request {
    std::string path;
};

struct describe_response {
    listed_name name;
    std::vector<service_entry> services;
    std::vector<schema_text> schemas; ///< those that `services` name, as far as they were told
    duration lease{};
    duration lease_age{};             ///< since it was last renewed
};

struct watch_request {
    std::string prefix; ///< as in list_request
};

enum class name_change : std::uint8_t { added, changed, removed };

struct name_event {
    name_change what = name_change::added;
    listed_name name;
};

/// What has changed under a watched prefix. The first packet is a snapshot, and so is the first after the server was
/// restarted: whatever was known before is replaced by it. Who loses a packet (`lost_before()`) subscribes anew.
struct name_events {
    bool snapshot = false;
    std::vector<name_event> events;
};

// --- the services of the name server ------------------------------------------------------------------------------

inline constexpr request_response<register_request, register_response> enroll{"ise.names.register"};
inline constexpr request_response<renew_request, renew_response> renew{"ise.names.renew"};
inline constexpr request_response<withdraw_request, withdraw_response> withdraw{"ise.names.withdraw"};
/// errc::no_such_name: nobody holds it; errc::name_server_lost: the server has just restarted and cannot say.
inline constexpr request_response<resolve_request, resolve_response> resolve{"ise.names.resolve"};
/// Answers when somebody holds it, or without a holder after the wait.
inline constexpr request_response<await_request, await_response> wait_for{"ise.names.await"};
inline constexpr request_response<list_request, list_response> list{"ise.names.list"};
inline constexpr request_response<describe_request, describe_response> describe{"ise.names.describe"};
inline constexpr subscription<name_events, watch_request> watch{"ise.names.watch"};

inline constexpr duration longest_wait = std::chrono::seconds(10);

/// Whether `path` is `prefix` or lies below it; every path lies below an empty one.
inline bool lies_below(std::string_view path, std::string_view prefix) noexcept {
    while (prefix.ends_with('/')) prefix.remove_suffix(1);
    return prefix.empty() || (path.starts_with(prefix) && (path.size() == prefix.size() || path[prefix.size()] == '/'));
}

} // namespace ise::naming
