#pragma once
#include <ise/component/program_executor.hpp>
#include <ise/core/endpoint.hpp>
#include <ise/core/log.hpp>
#include <ise/core/time.hpp>
#include <ise/session/service_options.hpp>
#include <ise/transport/security.hpp>

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace ise {

/// The reaction to an exception that escapes from a component.
enum class on_failure : std::uint8_t {
    stop_component, ///< the component stops; the others continue
    stop_node,      ///< all components of the node stop
    restart,        ///< the component is restarted with back-off
};

/// Options for all components of a node.
struct node_options {
    std::string name; ///< for people, such as the name of the process
    /// Name servers that share a store, in the order in which they are tried. Empty: those of ISE_NAME_SERVER, else
    /// tcp://127.0.0.1:7400.
    std::vector<endpoint> name_servers;
    bool use_names = true;                    ///< false: components are reached by endpoint only
    duration lease = std::chrono::seconds(2); ///< of the names
    duration grace = std::chrono::seconds(2); ///< for coroutines and sessions to end when stopped
    /// How long the thread of a component polls for events before it sleeps, at most 1 s. This saves the wake-up and
    /// keeps a core busy. Polling is adaptive: without events in that time, or if others need the core, the thread
    /// sleeps and polls again later (docs/embedding.md). Default: ISE_POLL_US, else no polling.
    std::optional<duration> poll;
    service_options services;       ///< limits and times of sessions, calls and subscriptions
    log_sink log = log_to_stderr(); ///< the sink of all log records of the node
    /// Its credentials, loaded when the node is made. Default of empty fields: ISE_KEY and ISE_TLS.
    security_options security;
    /// Where it serves its metrics to Prometheus: a port of the loopback interface ("9464"), or an address with a port
    /// ("0.0.0.0:9464"). "none": nowhere. Default: ISE_METRICS, else nowhere. See docs/metrics.md.
    std::string metrics;
    /// Where spans of calls go, as OTLP/JSON: a file, or the URL of a collector ("http://127.0.0.1:4318"). "none":
    /// there are none. Default: ISE_TRACES, else none. See docs/metrics.md.
    std::string traces;
    /// The share of traces begun here that are kept, from 0 to 1. Default: ISE_TRACE_RATE, else the first 100 of each
    /// second.
    std::optional<double> trace_rate;
};

class live_parameters;

/// Options of one component.
struct component_options {
    /// Endpoints to listen on. Default: an in-process name, shared memory, a local socket and a port of
    /// the loopback interface.
    std::vector<endpoint> listen;
    /// Further endpoints to register, for a listener behind a tunnel or an address translation. With a shared key, a
    /// session that was dialled neither to one of these nor to the endpoint where it arrived is refused.
    std::vector<endpoint> advertise;
    bool listens = true;   ///< false: it is only a client
    bool registers = true; ///< at the name server, if it has a path
    /// Roles that it serves beside its own name, with its priorities: the highest is preferred. Several components may
    /// serve one role; clients that look for the role get the live member with the highest priority.
    std::map<std::string, std::int32_t> roles;
    on_failure policy = on_failure::stop_component; ///< when an exception escapes from it
    /// An executor of the embedding program, run by any number of threads until the component has stopped
    /// (`node::stopped()`). `one_thread` guarantees that nothing on it runs concurrently, and saves the strand.
    program_executor executor;
    bool one_thread = false; ///< see `executor`
    /// Shares the loop of another component of this node, by path.
    std::string together_with;
    /// Its parameters, which others can read and, if they are changeable, set: component_type::live().
    std::shared_ptr<live_parameters> parameters;

    component_options() = default;
};

/// The result of stopping a component.
struct stop_report {
    /// Empty for an anonymous component.
    std::string path;
    std::vector<std::string> still_running; ///< coroutines that did not end within the grace, or its thread
    std::string failure;                    ///< the cause, if it has failed and was not restarted since
    unsigned restarts = 0;                  ///< by `on_failure::restart`
};

} // namespace ise
