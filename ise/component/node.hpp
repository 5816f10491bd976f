#pragma once
#include <ise/component/component.hpp>
#include <ise/component/node_options.hpp>

#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace ise {

struct node_state;

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
    std::shared_ptr<node_state> state_;
};

/// Runs until SIGINT or SIGTERM, or until every component has stopped; then stops the node. For programs: it handles
/// the two signals while it runs, which the library itself never does. Gives the program's exit code: 1 if a component
/// failed. `on_started` runs once the signals are handled.
int run_until_signal(node& running, const std::function<void()>& on_started = {});

} // namespace ise
