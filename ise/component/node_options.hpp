#pragma once
#include <ise/core/endpoint.hpp>
#include <ise/core/log.hpp>
#include <ise/core/time.hpp>
#include <ise/net/security.hpp>
#include <ise/service/service_options.hpp>

#include <asio/any_io_executor.hpp>

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace ise {

/// What becomes of the others when an exception escapes from a component.
enum class on_failure : std::uint8_t {
    stop_component, ///< it stops; the others go on
    stop_node,      ///< everything stops
    restart,        ///< it is started again, after a pause that grows
};

/// What holds for all components of a node.
struct node_options {
    std::string name;                          ///< for people; the process' name or the like
    std::optional<endpoint> name_server;       ///< else ISE_NAME_SERVER, else tcp://127.0.0.1:7400
    bool use_names = true;                     ///< false: components are reached by endpoint only
    duration lease = std::chrono::seconds(2);  ///< of the names
    duration grace = std::chrono::seconds(2);  ///< for coroutines and sessions to end when stopped
    /// How long the thread of a component looks for what comes next before it sleeps: what comes meanwhile is found without
    /// waking anybody, for a core that is kept busy. As long as that pays: where nothing comes in that time, or others
    /// need the core, it sleeps and tries again later (docs/embedding.md). Else ISE_POLL_US, else not at all; at most 1 s.
    std::optional<duration> poll;
    service_options services;                  ///< limits and times of sessions, calls and subscriptions
    log_sink log = log_to_stderr();            ///< where everything of the node logs to
    /// Where its credentials lie, which are loaded when it is made; what is empty comes from ISE_KEY and ISE_TLS.
    security_options security;
};

class live_parameters;

/// How one component is started.
struct component_options {
    /// Where it listens; empty: an in-process name, a local socket and a port of the loopback interface.
    std::vector<endpoint> listen;
    /// Further addresses to register, for a listener that others reach through something else: a tunnel, an address
    /// translation. With a shared key a session that was dialled to none of these, nor where it came in, is refused.
    std::vector<endpoint> advertise;
    bool listens = true;                       ///< false: it only asks others
    bool registers = true;                     ///< with the name server, if it has a path
    /// Roles that it serves beside its own name, with its priority there: the highest is preferred. Several components
    /// serve one role; who looks for the role finds the best of them that lives.
    std::map<std::string, std::int32_t> roles;
    on_failure policy = on_failure::stop_component; ///< when an exception escapes from it
    /// An executor of the embedding program, run by any number of threads, already or later, until the component has
    /// stopped (`node::stopped()`). `one_thread` promises that nothing on it runs concurrently, and saves the strand.
    std::optional<asio::any_io_executor> executor;
    bool one_thread = false; ///< see `executor`
    /// Shares the loop of another component of this node, by path.
    std::string together_with;
    /// What it was started with, for others to read and, where it allows that, to change: component_type::live().
    std::shared_ptr<live_parameters> parameters;

    component_options() = default;
};

/// What a stopped component left behind.
struct stop_report {
    /// Empty for an anonymous one.
    std::string path;
    std::vector<std::string> still_running; ///< coroutines that did not end within the grace, or its thread
    std::string failure;                    ///< why it failed, if it did and was not started again since
    unsigned restarts = 0;                  ///< by `on_failure::restart`
};

} // namespace ise
