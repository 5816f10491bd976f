#pragma once
#include <ise/component/component_owner.hpp>
#include <ise/component/component_runner.hpp>
#include <ise/component/node_options.hpp>
#include <ise/component/observing.hpp>

#include <atomic>
#include <condition_variable>
#include <list>
#include <map>
#include <mutex>
#include <string>
#include <vector>

namespace ise {

/// What a node is behind its interface: the components, its own loop, and the names that it keeps there.
struct node_state final : component_owner, std::enable_shared_from_this<node_state> {
    node_state(environment& of, node_options given, security loaded);
    ~node_state();

    /// How often it looks whether the loops of its components turn; more often where a peer wants to hear from one
    /// sooner.
    static constexpr duration watch_period = std::chrono::milliseconds(500);

    ise::loop& loop() noexcept override { return host->loop(); }
    registrar* names() const noexcept override { return kept_names.get(); }
    void start_names();
    /// Serves metrics and exports spans, where that is asked for. Throws ise::error: address_in_use and the like.
    void start_observing();
    void watch_loops();
    /// Looks at once, and often enough from then on, unless it does already. From any thread.
    void watch_sooner(duration heartbeat) override;
    void stop_all() override;
    void on_stopped() override;
    bool all_stopped() const;
    /// The one that runs under a path, else one that has stopped.
    std::shared_ptr<component_runner> find(const std::string& path) const;
    /// Takes a component in under its path, in the place of a stopped one. Throws errc::name_taken.
    void take_in(const std::shared_ptr<component_runner>& made);
    void let_go(const component_runner& which);
    /// The loop that a new component shall run on.
    std::shared_ptr<loop_share> loop_for(const std::string& path, const component_options& wanted);

    environment& env;
    node_options options;
    std::shared_ptr<loop_host> host;
    logger log;

    // On the node's loop.
    std::unique_ptr<task_scope> scope;
    std::unique_ptr<service_host> services;
    std::unique_ptr<registrar> kept_names;
    std::unique_ptr<timer> watch;
    std::unique_ptr<detail::observing> metrics, traces; // null: it serves none, it exports none
    time_point poke_at{};
    std::atomic<duration> watched_every{watch_period}; // from any thread

    mutable std::mutex mutex;
    std::condition_variable changed;
    std::list<std::shared_ptr<component_runner>> runners; // as they were started
    std::multimap<std::string, std::list<std::shared_ptr<component_runner>>::iterator> by_path;
    std::vector<unique_function<void()>> when_stopped;
    const security credentials;
};

} // namespace ise
