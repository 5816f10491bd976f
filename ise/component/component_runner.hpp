#pragma once
#include <ise/component/component_owner.hpp>
#include <ise/component/introspection.hpp>
#include <ise/component/job_count.hpp>
#include <ise/component/loop_share.hpp>
#include <ise/component/node_options.hpp>
#include <ise/component/runnable.hpp>
#include <ise/core/task_scope.hpp>
#include <ise/naming/registrar.hpp>
#include <ise/service/back_off.hpp>
#include <ise/service/service_host.hpp>

#include <atomic>
#include <memory>
#include <mutex>
#include <string>

namespace ise {

struct access_report;

/// Runs one component: its loop, its coroutines, its services, from starting to stopped. Made by a node; everything but
/// the constructor, `stop()` and what reads atomics happens on the component's loop.
class component_runner : public std::enable_shared_from_this<component_runner> {
public:
    component_runner(std::weak_ptr<component_owner> of, environment& env, std::shared_ptr<loop_share> share,
                     std::string path, std::unique_ptr<runnable> made, component_options options,
                     const node_options& node, const security& credentials, std::uint64_t incarnation);
    ~component_runner();

    /// Listens, provides ISE's own services and starts the flow. Throws what listening refuses; then nothing listens,
    /// and what was begun ends by itself.
    void start();
    /// From any thread, any number of times.
    void stop();

    const std::string& path() const noexcept { return path_; }
    std::uint64_t incarnation() const noexcept { return services_->self().incarnation; }
    component_state state() const noexcept { return state_.load(); }
    loop& on() noexcept { return share_->host->loop(); }
    environment& env() noexcept { return env_; }
    const std::shared_ptr<loop_share>& share() const noexcept { return share_; }
    stop_report report() const;
    bool stop_asked() const noexcept { return stop_asked_.load(); }
    /// Stopped or failed: nothing more comes from it.
    bool over() const noexcept { return state() >= component_state::stopped; }
    /// Whether nothing of it runs any more and it can be destroyed; else see leave_behind().
    bool ended() const noexcept { return ended_.load() && jobs_->none(); }

    // For the component.
    service_host& services() noexcept { return *services_; }
    const logger& log() const noexcept { return log_; }
    task_scope& flow() noexcept { return *flow_; }
    task<> ready(); ///< see `component::ready`. Cancellation: terminal
    void add(std::shared_ptr<call_service> service);
    void add(std::shared_ptr<publication_core> service);
    void withdraw_service(const std::string& name);
    void declare_required(const std::string& name, const packet_types& types);
    void serve_role(const std::string& role, std::int32_t priority);
    void leave_role(const std::string& role);
    bool name_confirmed() const;
    void stop_as_failed(std::string why);

    // For the node: from any thread.
    void on_name_change(result<std::uint64_t> epoch);
    /// Through which peers hear that it lives while its loop does not turn.
    net::heartbeat_senders& signs() noexcept { return *signs_; }
    std::atomic<bool> stalled{false};
    /// Counts it as stopped although its thread does not come back to its loop, or its executor is not run, for longer
    /// than stopping may take. True if it was given up now.
    bool give_up_if_late();
    /// Something that runs on another thread for it, as long as the result is held.
    std::shared_ptr<void> begin_job() { return jobs_->begin(); }
    /// Waits for all of that; from a thread that may wait.
    void wait_for_jobs() { jobs_->wait(); }

private:
    void open();
    void make_flow();
    void begin_flow();
    void announce();
    void tell_announced();
    task<> enroll(std::shared_ptr<component_runner> self);
    registration describe_for_names() const;
    void services_changed();
    void tell_roles();
    void lose_name(const failure& why);
    component_info describe_self() const;
    access_report tell_access(const call_context& by) const;
    void on_child_failure(const std::string& name, std::exception_ptr thrown);
    task<> restart();
    static task<> shut_down(std::shared_ptr<component_runner> self);
    void finish();
    void fail(std::string why);

    std::weak_ptr<component_owner> node_;
    environment& env_;
    std::shared_ptr<loop_share> share_;
    std::string path_;
    component_options options_;
    duration grace_;
    bool names_;
    std::vector<endpoint> name_servers_;
    logger log_;
    std::atomic<component_state> state_{component_state::starting};
    std::atomic<bool> stop_asked_{false};
    std::atomic<bool> ended_{false};
    std::atomic<duration::rep> stop_limit_{duration::max().count()}; // when it is given up
    std::shared_ptr<net::heartbeat_senders> signs_;
    std::shared_ptr<job_count> jobs_ = std::make_shared<job_count>();

    // On the loop. The component goes first, then its coroutines' owners, then its services.
    std::unique_ptr<task_scope> connections_;
    std::unique_ptr<service_host> services_;
    std::unique_ptr<task_scope> flow_;
    std::unique_ptr<runnable> component_;
    std::vector<std::string> own_services_; // what the flow provided: withdrawn when it restarts
    std::vector<waiter<>*> awaiting_announced_;
    back_off pause_;
    time_point flow_began_{};
    bool announcing_ = false;
    bool announced_ = false;
    bool name_lost_ = false;
    bool restarting_ = false;

    mutable std::mutex report_mutex_;
    stop_report report_;
};

} // namespace ise
