// How a component fails, is restarted, and ends.
#include <ise/component/component_runner.hpp>

#include <ise/core/async_run.hpp>
#include <ise/core/sleep.hpp>
#include <ise/service/session.hpp>

#include <asio/detached.hpp>
#include <asio/post.hpp>

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace ise {
namespace {

// A flow that ran for this long was a good one: the next restart begins with the shortest pause.
constexpr duration steady_flow = std::chrono::seconds(60);

} // namespace

void component_runner::fail(std::string why) {
    std::lock_guard lock(report_mutex_);
    report_.failure = std::move(why);
}

void component_runner::on_child_failure(const std::string& name, std::exception_ptr thrown) {
    log_.error("an exception escaped", {{"coroutine", name}, {"cause", describe(thrown)}});
    fail(fmt::format("{}: {}", name, describe(thrown)));
    if (stop_asked_) return;
    switch (options_.policy) {
        case on_failure::stop_component: stop(); break;
        case on_failure::stop_node:
            stop();
            if (auto owner = node_.lock()) owner->stop_all();
            break;
        case on_failure::restart:
            if (!std::exchange(restarting_, true)) connections_->spawn("restart", restart());
            break;
    }
}

// Peers see their sessions end, and come back when there is something to come back to.
task<> component_runner::restart() {
    state_ = component_state::starting;
    flow_->stop();
    bool ended = co_await flow_->join_until(saturating_add(on().now(), grace_));
    if (!ended) {
        log_.error("cannot be restarted: coroutines of its last flow still run",
                   {{"coroutines", fmt::format("{}", fmt::join(flow_->running(), ", "))}});
        stop();
        co_return;
    }
    if (stop_asked_) co_return;
    services_->pause(failure(errc::peer_lost, fmt::format("'{}' restarts after a failure", path_)), grace_ / 2);
    // Subscribers shall not hear that the services have ended, which they have not.
    co_await services_->peers().ended(saturating_add(on().now(), grace_ / 2));
    for (const auto& name : std::vector(own_services_)) withdraw_service(name);
    if (on().now() - flow_began_ >= steady_flow) pause_.reset();
    auto pause = pause_.next();
    log_.warning("restarts", {{"after_s", fmt::format("{:.3f}", std::chrono::duration<double>(pause).count())}});
    co_await sleep_for(on(), pause);
    if (stop_asked_) co_return;
    make_flow();
    restarting_ = false;
    {
        std::lock_guard lock(report_mutex_);
        report_.failure.clear();
        ++report_.restarts;
    }
    begin_flow();
}

void component_runner::stop() {
    if (stop_asked_.exchange(true)) return;
    stop_limit_ = saturating_add(env_.now(), grace_ * 3 + std::chrono::milliseconds(100)).time_since_epoch().count();
    // Through the gate, as everything from other threads: a loop that has ended meanwhile keeps nothing.
    on().gate()->post(
        [self = shared_from_this()] { async_run(self->on().get_executor(), shut_down(self), asio::detached); });
}

// Its own coroutines first, then its sessions say goodbye, then everything that carried them.
task<> component_runner::shut_down(std::shared_ptr<component_runner> self) {
    auto& me = *self;
    auto limit = saturating_add(me.on().now(), me.grace_);
    if (!me.over()) me.state_ = component_state::stopping;
    if (auto owner = me.node_.lock();
        owner && owner->names() && me.announcing_ && !me.path_.empty() && me.options_.registers)
        async_run(owner->loop().get_executor(), owner->names()->withdraw(me.path_, me.incarnation()), asio::detached);

    std::vector<std::string> still;
    auto note = [&still](const task_scope& scope) {
        auto names = scope.running();
        still.insert(still.end(), names.begin(), names.end());
    };
    if (me.flow_) {
        me.flow_->stop();
        bool ended = co_await me.flow_->join_until(limit);
        if (!ended) note(*me.flow_);
    }
    me.services_->stop(me.grace_ / 2);
    co_await me.services_->peers().ended(saturating_add(me.on().now(), me.grace_ / 2));
    me.connections_->stop();
    bool closed = co_await me.connections_->join_until(saturating_add(me.on().now(), me.grace_));
    if (!closed) note(*me.connections_);
    for (const auto& name : still) me.log_.error("a coroutine did not end in time", {{"coroutine", name}});
    {
        std::lock_guard lock(me.report_mutex_);
        me.report_.still_running = std::move(still);
    }
    // Not within a turn of the loop, which may be gone when this returns.
    asio::post(me.on().get_executor(), [self] { self->finish(); });
}

void component_runner::finish() {
    if (--share_->unfinished == 0 && share_->adopted) share_->host->end();
    bool failed = !report().failure.empty();
    auto owner = node_.lock();
    ended_ = true; // whoever sees that it is over may destroy it as soon as its loop has let go
    state_ = failed ? component_state::failed : component_state::stopped;
    if (owner) owner->on_stopped();
}

bool component_runner::give_up_if_late() {
    if (over() || env_.now().time_since_epoch().count() < stop_limit_) return false;
    std::string what = share_->adopted ? "its executor, which is blocked or not run by the program"
                                       : "its thread, which does not come back to its loop";
    log_.error("cannot be stopped and is left behind", {{"still_running", what}});
    {
        std::lock_guard lock(report_mutex_);
        report_.still_running.push_back(what);
        if (report_.failure.empty()) report_.failure = "could not be stopped: " + what;
    }
    auto now = state_.load();
    while (now < component_state::stopped && !state_.compare_exchange_weak(now, component_state::failed)) {}
    return true;
}

} // namespace ise
