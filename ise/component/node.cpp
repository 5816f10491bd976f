#include <ise/component/node.hpp>

#include <ise/component/node_state.hpp>
#if __has_include(<ise/naming/lease_registrar.hpp>)
#include <ise/naming/lease_registrar.hpp>
#include <ise/naming/services.hpp>
#define ISE_HAS_NAMES 1
#endif

#include <asio/co_spawn.hpp>
#include <asio/use_future.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <future>

namespace ise {
namespace {

constexpr duration watch_period = std::chrono::milliseconds(500);

bool good_path(const std::string& path) {
    bool letters = std::ranges::all_of(path, [](unsigned char letter) {
        return (letter >= 'a' && letter <= 'z') || (letter >= 'A' && letter <= 'Z') || (letter >= '0' && letter <= '9') ||
               letter == '_' || letter == '-' || letter == '.' || letter == '/';
    });
    return letters && path.size() <= 200 && !path.starts_with('/') && !path.ends_with('/') && path.find("//") == std::string::npos;
}

class coroutine_component final : public component {
public:
    explicit coroutine_component(std::function<task<>(component&)> body) : body_(std::move(body)) {}

private:
    task<> run() override { return body_(*this); }

    std::function<task<>(component&)> body_;
};

} // namespace

node::state::state(environment& of, node_options given)
    : env(of), options(std::move(given)), host(of.make_loop(options.name.empty() ? "ise-node" : options.name)),
      log(of, options.name.empty() ? "node" : options.name, options.log) {}

node::state::~state() = default;

void node::state::start_names() {
    scope = std::make_unique<task_scope>(loop(), [this](const std::string& name, std::exception_ptr thrown) {
        log.error(describe(thrown), {{"coroutine", name}});
    });
    wire::identity self;
    self.host_name = env.identity().host_name;
    self.process_key = env.identity().process_key;
    self.incarnation = env.random();
    services = std::make_unique<service_host>(env, loop(), *scope, std::move(self), options.services, log);
#ifdef ISE_HAS_NAMES
    names = std::make_unique<lease_registrar>(*services, *options.name_server, options.lease);
    names->on_change = [this](const std::string& path, result<std::uint64_t> epoch) {
        if (auto runner = find(path)) runner->on_name_change(std::move(epoch));
    };
#endif
}

task<result<std::uint64_t>> node::state::enroll(registration who, duration deadline) { return names->enroll(std::move(who), deadline); }

// A component whose loop does not turn is shown as stalled; its name and its lease do not suffer.
void node::state::watch_loops() {
    std::vector<std::shared_ptr<component_runner>> all;
    {
        std::lock_guard lock(mutex);
        all = runners;
    }
    for (auto& runner : all) {
        bool turning = runner->poke();
        if (runner->stalled.exchange(!turning) == !turning) continue;
        if (turning) {
            log.info("a component goes on", {{"component", runner->path()}});
        } else {
            log.warning("a component is stalled: its thread does not come back to its loop", {{"component", runner->path()}});
        }
        if (names && !runner->path().empty()) names->set_state(runner->path(), turning ? name_of(runner->state()) : "stalled");
    }
    watch->arm(saturating_add(loop().now(), watch_period));
}

std::shared_ptr<component_runner> node::state::find(const std::string& path) const {
    std::lock_guard lock(mutex);
    for (const auto& runner : runners)
        if (runner->path() == path) return runner;
    return nullptr;
}

void node::state::stop_all() {
    std::vector<std::shared_ptr<component_runner>> all;
    {
        std::lock_guard lock(mutex);
        all = runners;
    }
    for (auto& runner : all) runner->stop();
}

bool node::state::all_stopped() const {
    return std::ranges::all_of(runners, [](const auto& runner) {
        return runner->state() == component_state::stopped || runner->state() == component_state::failed;
    });
}

void node::state::on_stopped() {
    std::vector<unique_function<void()>> waiting;
    {
        std::lock_guard lock(mutex);
        if (all_stopped()) waiting = std::exchange(when_stopped, {});
    }
    changed.notify_all();
    for (auto& resume : waiting) resume();
}

node::node(environment& env, node_options options) {
    if (options.use_names && !options.name_server) {
        auto told = env.variable("ISE_NAME_SERVER");
#ifdef ISE_HAS_NAMES
        options.name_server = told ? endpoint::parse(*told).value() : default_name_server();
#endif
    }
    state_ = std::make_shared<state>(env, std::move(options));
    auto setup = [held = state_] {
        if (held->options.use_names) held->start_names();
        if (!held->env.is_virtual()) {
            held->watch = std::make_unique<timer>(held->loop(), [raw = held.get()] { raw->watch_loops(); });
            held->watch->arm(saturating_add(held->loop().now(), watch_period));
        }
    };
    if (env.is_virtual()) {
        setup();
    } else {
        asio::post(state_->loop().get_executor(), std::packaged_task<void()>(setup)).get();
    }
}

node::~node() {
    stop();
    if (!state_->env.is_virtual()) {
        wait();
        // Components withdrew their names; the node's own sessions end with its loop.
        std::promise<void> closed;
        auto over = closed.get_future();
        auto closing = [](std::shared_ptr<state> held) -> task<> {
            held->watch.reset();
            if (held->services) {
                held->services->stop(held->options.grace / 4);
                held->scope->stop();
                co_await held->scope->join_until(saturating_add(held->loop().now(), held->options.grace));
            }
        };
        asio::co_spawn(state_->loop().get_executor(), closing(state_), [&closed](std::exception_ptr) { closed.set_value(); });
        over.get();
    }
    // The loops end before what their coroutines use.
    for (auto& runner : state_->runners) runner->end_loop();
    state_->runners.clear();
    state_->host.reset();
}

component& node::start(const std::string& path, std::function<task<>(component&)> body, component_options options) {
    return launch(path, std::make_unique<coroutine_component>(std::move(body)), std::move(options));
}

component& node::launch(const std::string& path, std::unique_ptr<component> made, component_options options) {
    if (!good_path(path))
        throw error(errc::invalid_argument, fmt::format("'{}' is no path of a component: write it like atirma/shore/xbee", path));
    if (!path.empty())
        if (auto other = state_->find(path); other && other->state() != component_state::stopped && other->state() != component_state::failed)
            throw error(errc::name_taken, fmt::format("this node runs '{}' already", path));

    bool adopted = options.executor.has_value();
    std::shared_ptr<loop_host> host;
    if (adopted) {
        host = state_->env.adopt(*options.executor, options.one_thread);
    } else if (!options.together_with.empty()) {
        auto other = state_->find(options.together_with);
        if (!other) throw error(errc::invalid_argument, fmt::format("'{}' shall share the loop of '{}', which this node does not run", path, options.together_with));
        host = other->host();
    } else {
        host = state_->env.make_loop(path.empty() ? "component" : path.substr(path.rfind('/') + 1));
    }
    auto& reference = *made;
    auto incarnation = state_->env.random() | 1; // never 0
    auto runner = std::make_shared<component_runner>(state_, state_->env, std::move(host), path, std::move(made), std::move(options),
                                                     state_->options, incarnation);
    // On an adopted executor, which may not run yet, the caller sees to it that nothing else runs there now.
    if (adopted || state_->env.is_virtual() || runner->on().running_here()) {
        runner->start();
    } else {
        auto started = asio::post(runner->on().get_executor(), std::packaged_task<void()>([runner] { runner->start(); }));
        try {
            started.get();
        } catch (...) {
            runner->end_loop();
            throw;
        }
    }
    std::lock_guard lock(state_->mutex);
    state_->runners.push_back(std::move(runner));
    return reference;
}

void node::stop(const std::string& path) {
    if (auto runner = state_->find(path)) runner->stop();
}

void node::stop() { state_->stop_all(); }

void node::wait() {
    if (state_->env.is_virtual()) throw error(errc::would_block_self, "a blocking wait in the virtual world would stop its only thread: co_await stopped()");
    std::unique_lock lock(state_->mutex);
    state_->changed.wait(lock, [this] { return state_->all_stopped(); });
}

task<> node::stopped() {
    return asio::async_initiate<const asio::use_awaitable_t<>, void()>(
        [](auto handler, std::shared_ptr<state> held) {
            auto executor = asio::get_associated_executor(handler);
            unique_function<void()> resume = [handler = std::move(handler), executor]() mutable { asio::post(executor, std::move(handler)); };
            {
                std::lock_guard lock(held->mutex);
                if (!held->all_stopped()) {
                    held->when_stopped.push_back(std::move(resume));
                    return;
                }
            }
            resume();
        },
        asio::use_awaitable, state_);
}

std::vector<stop_report> node::reports() const {
    std::lock_guard lock(state_->mutex);
    std::vector<stop_report> all;
    for (const auto& runner : state_->runners)
        if (runner->state() == component_state::stopped || runner->state() == component_state::failed) all.push_back(runner->report());
    return all;
}

bool node::all_stopped() const {
    std::lock_guard lock(state_->mutex);
    return state_->all_stopped();
}

environment& node::env() noexcept { return state_->env; }
const node_options& node::options() const noexcept { return state_->options; }

} // namespace ise
