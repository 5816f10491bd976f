#pragma once
#include <ise/subscription/subscriber_core.hpp>

#include <cstdint>
#include <string>
#include <vector>

namespace seeds {

/// What a seed means: everything that is decided before the run. What is drawn during it comes from generators of each
/// coroutine's own.

struct subscriber_plan {
    std::size_t provider = 0; ///< component
    bool by_name = true;
    bool later_version = false;
    ise::subscribe_options terms;
    ise::duration slowness{}; ///< after each packet; zero: takes it at once
    bool leaves = false;      ///< now and then, and subscribes anew
};

struct publisher_plan {
    ise::duration period{};
    std::uint32_t burst = 1; ///< packets at once
    std::uint32_t bytes = 0; ///< of content, at most
    bool blocking = false;   ///< waits for room
    bool withdraws = false;  ///< the service comes and goes
};

struct component_plan {
    std::string path;
    std::size_t process = 0;
    std::uint16_t port = 0;
    bool with_the_first = false; ///< on the loop of its process' first component
    bool fails = false;          ///< its flow throws now and then, and is restarted
    bool later_version = false;  ///< provides the later packets
    bool over_datagrams = false; ///< listens on udp only
    std::string role;            ///< that it serves; empty: none
    std::int32_t priority = 0;   ///< there
    std::uint32_t callers = 0;
    ise::duration pause{}; ///< of a caller, between two calls, at most
    bool short_deadlines = false;
    std::uint32_t request_bytes = 0; ///< at most
    publisher_plan publishes;
    std::vector<subscriber_plan> subscribes;
};

struct process_plan {
    std::string host;
    std::string name;
};

enum class fault_kind : std::uint8_t {
    partition,     ///< of two hosts
    isolation,     ///< of a host from all
    weak_link,     ///< loss, delay, jitter
    narrow_link,   ///< little bandwidth
    cut,           ///< the next connections between two hosts break after some bytes
    crash,         ///< of a process; it comes back
    quick_restart, ///< of a process, at once
    stop,          ///< of a process, in order; it comes back
    freeze,        ///< of a process, as by SIGSTOP
    host_crash,
    server_crash, ///< the name server; it comes back
    server_freeze,
    broken_io,      ///< some operation of anybody fails
    rival,          ///< somebody else takes the name of a component that is cut off
    component_stop, ///< one component of a process stops and is started again
    unruly_link,    ///< datagrams are doubled and overtake each other; excuses nothing
    clock_step,     ///< of the wall clock of a process; excuses nothing
};
std::string_view name_of(fault_kind kind) noexcept;

struct fault_plan {
    fault_kind kind{};
    ise::duration at{};
    ise::duration length{};
    std::size_t process = 0; ///< or component
    std::string host, other;
    std::uint64_t amount = 0;
};

/// A bare holder of a name, that only wants it: several of them contend for each.
struct contender_plan {
    std::size_t process = 0; ///< of its own
    std::string path;
};

struct plan {
    std::uint64_t seed = 0;
    std::vector<std::string> hosts; ///< without the name server's
    std::vector<process_plan> processes;
    std::vector<component_plan> components;
    std::vector<contender_plan> contenders;
    std::vector<fault_plan> faults;
    ise::duration length{}; ///< of traffic with faults
    ise::duration linger{};
    ise::duration lease{};
    std::uint64_t heartbeat_ns = 0;
    std::size_t session_bytes = 0;
    ise::duration latency{};

    explicit plan(std::uint64_t seed);
    std::string text() const;
    /// The hosts of who serves a role.
    std::vector<std::string> hosts_of_role(const std::string& role) const;
};

} // namespace seeds
