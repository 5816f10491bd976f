#include <ise/component/node_state.hpp>

#include <ise/component/observing.hpp>
#include <ise/naming/lease_registrar.hpp>

#include <fmt/format.h>

#include <algorithm>

namespace ise {

node_state::node_state(environment& of, node_options given, security loaded)
    : env(of), options(std::move(given)), host(of.make_loop(options.name.empty() ? "ise-node" : options.name)),
      log(of, options.name.empty() ? "node" : options.name, options.log), credentials(std::move(loaded)) {}

node_state::~node_state() = default;

void node_state::start_names() {
    scope = std::make_unique<task_scope>(loop(), [this](const std::string& name, std::exception_ptr thrown) {
        log.error(describe(thrown), {{"coroutine", name}});
    });
    wire::identity self;
    self.host_name = env.identity().host_name;
    self.process_key = env.identity().process_key;
    self.incarnation = env.random();
    services = std::make_unique<service_host>(env, loop(), *scope, std::move(self), options.services, log, credentials);
    services->follow_access();
    kept_names = std::make_unique<lease_registrar>(*services, options.name_servers, options.lease);
    kept_names->on_change = [this](const registration& of, result<std::uint64_t> epoch) {
        auto runner = find(of.path);
        if (runner && runner->incarnation() == of.incarnation) runner->on_name_change(std::move(epoch));
    };
}

void node_state::start_observing() {
    if (auto at = detail::metrics_address(options.metrics)) metrics = detail::serve_metrics(*this, *at);
    if (options.services.traces) traces = detail::export_traces(*this);
}

// A component whose loop does not turn is shown as stalled; its name, its lease and its sessions do not suffer.
void node_state::watch_loops() {
    std::vector<std::shared_ptr<component_runner>> all;
    {
        std::lock_guard lock(mutex);
        all.assign(runners.begin(), runners.end());
    }
    auto now = loop().now();
    auto period = watch_period;
    for (auto& runner : all) {
        if (runner->give_up_if_late()) on_stopped();
        if (!runner->over()) {
            runner->signs().show(now);
            period = std::min(period, runner->signs().min_heartbeat() / 2);
        }
        if (now < poke_at) continue;
        bool turning = runner->over() || runner->share()->turns(now);
        if (!turning && runner->stop_asked()) continue; // many that stop at once keep their loop busy
        if (runner->stalled.exchange(!turning) == !turning) continue;
        if (turning) {
            log.info("a component goes on", {{"component", runner->path()}});
        } else {
            log.warning("a component is stalled: its thread does not come back to its loop",
                        {{"component", runner->path()}});
        }
        if (kept_names && !runner->path().empty())
            kept_names->set_state(runner->path(), runner->incarnation(),
                                  turning ? name_of(runner->state()) : "stalled");
    }
    if (now >= poke_at) poke_at = now + watch_period;
    watched_every = period;
    watch->arm(now + period);
}

void node_state::watch_sooner(duration heartbeat) {
    auto every = watched_every.load();
    do {
        if (heartbeat / 2 >= every) return;
    } while (!watched_every.compare_exchange_weak(every, heartbeat / 2));
    loop().gate()->post([weak = weak_from_this()] {
        auto held = weak.lock();
        if (held && held->watch) held->watch_loops();
    });
}

std::shared_ptr<component_runner> node_state::find(const std::string& path) const {
    std::lock_guard lock(mutex);
    std::shared_ptr<component_runner> stopped;
    auto [first, last] = by_path.equal_range(path);
    for (; first != last; ++first) {
        const auto& runner = *first->second;
        if (!runner->over()) return runner;
        stopped = runner;
    }
    return stopped;
}

void node_state::take_in(const std::shared_ptr<component_runner>& made) {
    std::shared_ptr<component_runner> old;
    std::unique_lock lock(mutex);
    auto [first, last] = by_path.equal_range(made->path());
    auto replaced = last;
    if (made->path().empty()) first = last;
    for (; first != last; ++first) {
        const auto& runner = *first->second;
        if (!runner->over()) throw error(errc::name_taken, fmt::format("this node runs '{}' already", made->path()));
        bool alone = !runner->share()->adopted && runner->share().use_count() == 1;
        if (runner->ended() && alone && !runner->on().running_here()) replaced = first;
    }
    if (replaced != last) {
        old = std::move(*replaced->second);
        runners.erase(replaced->second);
        by_path.erase(replaced);
    }
    by_path.emplace(made->path(), runners.insert(runners.end(), made));
    lock.unlock();
    // What it posted last may hold it still: it must not go on its own thread.
    if (old) old->share()->host->end();
}

void node_state::let_go(const component_runner& which) {
    std::lock_guard lock(mutex);
    auto [first, last] = by_path.equal_range(which.path());
    auto found = std::find_if(first, last, [&](const auto& one) { return one.second->get() == &which; });
    if (found == last) return;
    runners.erase(found->second);
    by_path.erase(found);
}

std::shared_ptr<loop_share> node_state::loop_for(const std::string& path, const component_options& wanted) {
    if (wanted.executor) return std::make_shared<loop_share>(env.adopt(*wanted.executor, wanted.one_thread), true);
    if (wanted.together_with.empty()) {
        auto made = env.make_loop(path.empty() ? "component" : path.substr(path.rfind('/') + 1));
        if (*options.poll > duration{}) made->poll(*options.poll);
        return std::make_shared<loop_share>(std::move(made), false);
    }
    auto other = find(wanted.together_with);
    if (!other || other->over())
        throw error(errc::invalid_argument,
                    fmt::format("'{}' shall share the loop of '{}', which this node does not run{}", path,
                                wanted.together_with, other ? " any more" : ""));
    return other->share();
}

void node_state::stop_all() {
    std::vector<std::shared_ptr<component_runner>> all;
    {
        std::lock_guard lock(mutex);
        all.assign(runners.begin(), runners.end());
    }
    for (auto& runner : all) runner->stop();
}

bool node_state::all_stopped() const { // they are stopped in their order, so that mostly the last one tells
    return std::all_of(runners.rbegin(), runners.rend(), [](const auto& runner) { return runner->over(); });
}

void node_state::on_stopped() {
    std::vector<unique_function<void()>> waiting;
    {
        std::lock_guard lock(mutex);
        if (all_stopped()) waiting = std::exchange(when_stopped, {});
    }
    changed.notify_all();
    for (auto& resume : waiting) resume();
}

} // namespace ise
