#pragma once
#include <ise/component/component.hpp>
#include <ise/net/security.hpp>
#include <ise/service/service_options.hpp>

#include <chrono>
#include <functional>
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

/// How a component of a node is, now.
struct component_status {
    /// Empty for an anonymous one.
    std::string path;
    component_state state{}; ///< where it is in its life
    bool stalled = false; ///< its thread has not come back to its loop for a while
};

/// A process' share of the system: it runs components, each on a loop of its own, and keeps their names alive.
///
/// In the real world its methods are called from a program's own threads (not from a component's loop) and block
/// where they say so; in the virtual world nothing blocks and `stopped()` is awaited instead.
class node {
public:
    /// `env` outlives the node. Throws errc::invalid_argument where ISE_NAME_SERVER is no endpoint or `poll` no time to
    /// look for, and what security::load fails with where the credentials cannot be used.
    explicit node(environment& env, node_options options = node_options());
    /// Stops what still runs, and waits for a bounded time: three times the grace and a little. A component whose thread
    /// does not come back to its loop in that time is named in the log and left behind: nothing more of it runs once
    /// its handler returns, and it is destroyed then, or with the executor that it was given; the environment must
    /// outlive it (real_environment's destructor waits). In the virtual world nothing is waited for: what still runs is
    /// destroyed where it is, as if the process had been killed.
    ~node();
    node(const node&) = delete;
    node& operator=(const node&) = delete;

    /// Starts a component under a path (empty: anonymous). Throws errc::invalid_argument for a path that is none,
    /// errc::name_taken for one that this node runs already, errc::address_in_use and the like when it cannot listen.
    /// errc::cancelled when it is stopped meanwhile. errc::would_block_self on an io_context of the program when the
    /// component shall share the loop of one that runs there. A start that throws leaves nothing behind.
    /// The reference is valid until the node is gone, or another component is started under the path of this one.
    template <class C, class... A>
        requires std::derived_from<C, component>
    C& start(const std::string& path, component_options options, A&&... arguments) {
        auto made = std::make_unique<C>(std::forward<A>(arguments)...);
        auto& reference = *made;
        launch(path, std::move(made), std::move(options));
        return reference;
    }
    /// With the usual options, made without arguments.
    template <class C>
        requires std::derived_from<C, component>
    C& start(const std::string& path) {
        return start<C>(path, component_options());
    }
    /// A component made of a coroutine: `node.start("atirma/probe", [](ise::component& self) -> ise::task<> {…})`.
    component& start(const std::string& path, std::function<task<>(component&)> body, component_options options = component_options());
    /// Starts a component that was made already; as `start`.
    component& launch(const std::string& path, std::unique_ptr<component> made, component_options options);

    /// Asks one component to stop, or all.
    void stop(const std::string& path);
    /// All of them. Returns at once, as does the other; any number of times.
    void stop();
    /// Blocks until every component has stopped by itself or by `stop()`, which takes a bounded time (see the
    /// destructor); not in the virtual world, and not on an executor that a component runs on.
    void wait();
    /// Completes when every component has stopped; on any executor of the virtual world, or one of the program's.
    task<> stopped();
    /// Of the components that have stopped so far.
    std::vector<stop_report> reports() const;
    /// Whether none runs (any more).
    bool all_stopped() const;
    /// Of all components, also those that have stopped.
    std::vector<component_status> components() const;

    /// The world it was made with.
    environment& env() noexcept;
    /// As it was made with.
    const node_options& options() const noexcept;

private:
    friend class component_runner;
    struct state;
    std::shared_ptr<state> state_;
};

/// Runs until SIGINT or SIGTERM, or until every component has stopped; then stops the node. For programs: it handles
/// the two signals while it runs, which the library itself never does. Gives the program's exit code: 1 if a component
/// failed. `on_started` runs once the signals are handled.
int run_until_signal(node& running, const std::function<void()>& on_started = {});

} // namespace ise
