#include <ise/component/node.hpp>

#include <ise/component/left_behind.hpp>
#include <ise/component/live_parameters.hpp>
#include <ise/component/node_state.hpp>
#include <ise/component/poll_window.hpp>
#include <ise/core/async_run.hpp>
#include <ise/core/use_task.hpp>
#include <ise/naming/lease_registrar.hpp>
#include <ise/naming/name_server_choice.hpp>

#include <asio/use_future.hpp>

#include <fmt/format.h>

#include <future>

namespace ise {
namespace {

// For a message, which may end at a zero or run over lines.
std::string printable(std::string text) {
    for (char& letter : text)
        if (static_cast<unsigned char>(letter) < 0x20 || letter == 0x7f) letter = '?';
    return text.size() <= 200 ? text : text.substr(0, 200) + "...";
}

void check_path(const std::string& path, std::string_view what) {
    if (path.size() > naming::max_path || !naming::is_path(path))
        throw error(errc::invalid_argument,
                    fmt::format("'{}' is no {}: write it like atirma/shore/xbee", printable(path), what));
}

class coroutine_component final : public component {
public:
    explicit coroutine_component(std::function<task<>(component&)> body) : body_(std::move(body)) {}

private:
    task<> run() override { return body_(*this); }

    std::function<task<>(component&)> body_;
};

} // namespace

node::node(environment& env, node_options options) {
    if (options.use_names) options.name_server = name_server_for(env, options.name_server).value();
    options.poll = detail::poll_window_of(options.poll, env);
    auto credentials = security::load(env, options.security).value();
    state_ = std::make_shared<node_state>(env, std::move(options), std::move(credentials));
    auto setup = [held = state_] {
        if (held->options.use_names) held->start_names();
        if (!held->env.is_virtual()) {
            held->watch = std::make_unique<timer>(held->loop(), [raw = held.get()] { raw->watch_loops(); });
            held->watch->arm(saturating_add(held->loop().now(), node_state::watch_period));
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
        auto closing = [](std::shared_ptr<node_state> held) -> task<> {
            held->watch.reset();
            if (held->names()) co_await held->names()->farewell();
            if (held->services) {
                held->services->stop(held->options.grace / 4);
                held->scope->stop();
                co_await held->scope->join_until(saturating_add(held->loop().now(), held->options.grace));
            }
        };
        async_run(state_->loop().get_executor(), closing(state_),
                  [&closed](std::exception_ptr) { closed.set_value(); });
        over.get();
    }
    // Every loop ends before what its coroutines use; those that cannot be ended now are left behind together with all
    // that runs on them.
    std::map<loop_share*, std::vector<std::shared_ptr<component_runner>>> by_loop;
    {
        std::lock_guard lock(state_->mutex);
        for (auto& runner : state_->runners) by_loop[runner->share().get()].push_back(runner);
        state_->by_path.clear();
        state_->runners.clear();
    }
    for (auto& [share, runners] : by_loop) {
        bool ended = state_->env.is_virtual() ||
                     std::ranges::all_of(runners, [](const auto& runner) { return runner->ended(); });
        if (!ended) {
            leave_behind(std::move(runners));
        } else if (!share->adopted || state_->env.is_virtual()) {
            share->host->end();
        }
    }
    by_loop.clear();
    state_->host->end();
}

component& node::start(const std::string& path, std::function<task<>(component&)> body, component_options options) {
    return launch(path, std::make_unique<coroutine_component>(std::move(body)), std::move(options));
}

component& node::launch(const std::string& path, std::unique_ptr<component> made, component_options options) {
    if (!path.empty()) check_path(path, "path of a component");
    for (const auto& [role, priority] : options.roles) check_path(role, "role of a component");
    if (options.roles.contains(path))
        throw error(errc::invalid_argument,
                    fmt::format("'{}' is the component's own name and needs not be a role of it", path));
    if (!options.roles.empty() && path.empty())
        throw error(errc::invalid_argument, "an anonymous component serves no role: give it a path");
    auto share = state_->loop_for(path, options);
    auto& reference = *made;
    auto parameters = options.parameters;
    auto incarnation = state_->env.random() | 1; // never 0
    auto runner =
        std::make_shared<component_runner>(state_, state_->env, share, path, std::move(made), std::move(options),
                                           state_->options, state_->credentials, incarnation);
    state_->take_in(runner); // first, so that whoever stops the node stops it too
    try {
        share->run_alone([&] {
            if (parameters) parameters->offer(runner->services(), reference);
            runner->start();
        });
    } catch (...) {
        runner->stop(); // it may not even have been let in; it counts among those of its loop until it has ended
        state_->let_go(*runner);
        bool alone = share.use_count() == 2; // here and in the runner
        if (alone && !share->adopted && !state_->env.is_virtual()) share->host->end();
        state_->on_stopped(); // for who waits for the last one
        throw;
    }
    return reference;
}

void node::stop(const std::string& path) {
    if (auto runner = state_->find(path)) runner->stop();
}

void node::stop() { state_->stop_all(); }

void node::wait() {
    if (state_->env.is_virtual())
        throw error(errc::would_block_self,
                    "a blocking wait in the virtual world would stop its only thread: co_await stopped()");
    std::unique_lock lock(state_->mutex);
    state_->changed.wait(lock, [this] { return state_->all_stopped(); });
}

task<> node::stopped() {
    auto begin = [](auto handler, std::shared_ptr<node_state> held) {
        auto executor = asio::get_associated_executor(handler);
        unique_function<void()> resume = [handler = std::move(handler), executor]() mutable {
            asio::post(executor, std::move(handler));
        };
        {
            std::lock_guard lock(held->mutex);
            if (!held->all_stopped()) {
                held->when_stopped.push_back(std::move(resume));
                return;
            }
        }
        resume();
    };
    co_await asio::async_initiate<const use_task_t, void()>(std::move(begin), use_task, state_);
}

std::vector<stop_report> node::reports() const {
    std::lock_guard lock(state_->mutex);
    std::vector<stop_report> all;
    for (const auto& runner : state_->runners)
        if (runner->over()) all.push_back(runner->report());
    return all;
}

std::vector<component_status> node::components() const {
    std::lock_guard lock(state_->mutex);
    std::vector<component_status> all;
    for (const auto& runner : state_->runners) {
        component_status status;
        status.path = runner->path();
        status.state = runner->state();
        status.stalled = runner->stalled;
        all.push_back(std::move(status));
    }
    return all;
}

bool node::all_stopped() const {
    std::lock_guard lock(state_->mutex);
    return state_->all_stopped();
}

environment& node::env() noexcept { return state_->env; }
const node_options& node::options() const noexcept { return state_->options; }

} // namespace ise
