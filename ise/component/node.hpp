#pragma once
#include <ise/component/component.hpp>
#include <ise/component/node_options.hpp>

#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace ise {

struct node_state;

/// The present state of a component of a node.
struct component_status {
    /// Empty for an anonymous component.
    std::string path;
    component_state state{}; ///< its state
    bool stalled = false;    ///< its thread has not returned to its loop for a while
};

/// The part of the system in one process: runs components, each on a loop of its own, and renews the leases of their
/// names.
///
/// In the real world its functions are called from the program's own threads (not from a component's loop) and block
/// as documented; in the virtual world nothing blocks, and `stopped()` is awaited instead.
class node {
public:
    /// `env` must outlive the node. Throws errc::invalid_argument if ISE_NAME_SERVER is not an endpoint or `poll` is
    /// out of range, and the errors of security::load if the credentials cannot be used.
    explicit node(environment& env, node_options options = node_options());
    /// Stops all components, and waits for a bounded time: a little more than three times the grace. A component whose
    /// thread does not return to its loop in that time is named in the log and abandoned: it is destroyed when its
    /// handler returns, or with its executor; the environment must outlive it (real_environment's destructor waits). In
    /// the virtual world the destructor does not wait: running components are destroyed at once, as if the process had
    /// been killed.
    ~node();
    node(const node&) = delete;
    node& operator=(const node&) = delete;

    /// Starts a component under a path (empty: anonymous). Throws errc::invalid_argument for a malformed path,
    /// errc::name_taken if this node runs the path already, errc::address_in_use and the like if it cannot listen,
    /// errc::cancelled if it is stopped meanwhile, errc::would_block_self on an io_context of the program if the
    /// component is to share the loop of one that runs there. A start that throws has no effect.
    /// The reference is valid until the node is destroyed, or another component is started under the same path.
    template <class C, class... A>
    requires std::derived_from<C, component> C& start(const std::string& path, component_options options,
                                                      A&&... arguments) {
        auto made = std::make_unique<C>(std::forward<A>(arguments)...);
        auto& reference = *made;
        launch(path, std::move(made), std::move(options));
        return reference;
    }
    /// The same with default options, and without arguments.
    template <class C>
    requires std::derived_from<C, component> C& start(const std::string& path) {
        return start<C>(path, component_options());
    }
    /// A component made of a coroutine: `node.start("atirma/probe", [](ise::component& self) -> ise::task<> {…})`.
    component& start(const std::string& path, std::function<task<>(component&)> body,
                     component_options options = component_options());
    /// Starts an existing component object; otherwise as `start`.
    component& launch(const std::string& path, std::unique_ptr<component> made, component_options options);

    /// Asks one component to stop, and returns at once.
    void stop(const std::string& path);
    /// Asks all components to stop, and returns at once. May be repeated.
    void stop();
    /// Blocks until every component has stopped by itself or by `stop()`, which takes a bounded time (see the
    /// destructor). Not allowed in the virtual world, nor on an executor of a component.
    void wait();
    /// Completes when every component has stopped. May be awaited on any executor of the virtual world or of the
    /// program. Cancellation: has no effect before it completes.
    task<> stopped();
    /// Reports of the components that have stopped so far.
    std::vector<stop_report> reports() const;
    /// Whether no component is running.
    bool all_stopped() const;
    /// The status of all components, including stopped ones.
    std::vector<component_status> components() const;

    /// The environment that was passed to the constructor.
    environment& env() noexcept;
    /// The options that were passed to the constructor.
    const node_options& options() const noexcept;

private:
    std::shared_ptr<node_state> state_;
};

/// Blocks until SIGINT or SIGTERM, or until every component has stopped; then stops the node. It handles the two
/// signals while it runs; no other function of the library does. Returns the program's exit code: 0, or 1 if a
/// component failed. `on_started` is called when the signal handlers are installed.
int run_until_signal(node& running, const std::function<void()>& on_started = {});

} // namespace ise
