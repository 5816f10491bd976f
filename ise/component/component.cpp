#include <ise/component/component.hpp>

#include <ise/component/component_runner.hpp>
#include <ise/service/session.hpp>

#include <asio/any_io_executor.hpp>
#include <asio/error.hpp>
#include <asio/post.hpp>

#include <fmt/format.h>

namespace ise {
namespace {

component_runner& started(component_runner* runner) {
    if (!runner)
        throw error(errc::invalid_argument,
                    "a component is used before it was started: do it in run(), not in the constructor");
    return *runner;
}

} // namespace

component::component() = default;
component::~component() = default;

const std::string& component::path() const { return started(runner_).path(); }
environment& component::env() const { return started(runner_).env(); }
loop& component::on() const { return started(runner_).on(); }
const asio::any_io_executor& component::get_executor() const { return started(runner_).on().get_executor(); }
const logger& component::log() const { return started(runner_).log(); }
component_state component::state() const noexcept { return runner_ ? runner_->state() : component_state::starting; }
service_host& component::services() const { return started(runner_).services(); }

void component::serve_role(const std::string& role, std::int32_t priority) {
    started(runner_).serve_role(role, priority);
}
void component::leave_role(const std::string& role) { started(runner_).leave_role(role); }
bool component::name_confirmed() const { return started(runner_).name_confirmed(); }
void component::on_name_lost(const failure& why) { started(runner_).stop_as_failed(why.message()); }

task<remote> component::find(std::string path, duration wait) { return find(std::move(path), role_options(), wait); }

task<remote> component::find(std::string path, role_options how, duration wait) {
    auto& services = started(runner_).services();
    auto way = services.link_to(path, how);
    auto until = saturating_add(on().now(), wait);
    auto found = co_await peer_channel::find(way, until);
    found.value();
    co_return remote(std::move(way));
}

remote component::at(const std::string& path, role_options how) {
    return remote(started(runner_).services().link_to(path, how));
}
remote component::at(const endpoint& where, const std::string& path) {
    return remote(started(runner_).services().link_to(where, path));
}
remote component::at(const std::vector<endpoint>& any_of, const std::string& path) {
    return remote(started(runner_).services().link_to(any_of, path));
}

remote component::caller(const call_context& context) {
    auto& services = started(runner_).services();
    for (const auto& [raw, held] : services.sessions())
        if (held->peer_name().data() == context.caller.data()) return remote(services.link_back(held));
    throw error(errc::peer_lost, fmt::format("the session with {} has ended", context.caller));
}

void component::spawn(std::string name, task<> body) {
    started(runner_).flow().spawn(std::move(name), std::move(body));
}
task<> component::ready() { return started(runner_).ready(); }
void component::stop() { started(runner_).stop(); }

namespace detail {
namespace {

struct offloaded {
    explicit offloaded(loop& on) : wake(on, uninterrupted) {} // the job uses its coroutine's variables
    unique_function<void()> job;
    waiter<> wake;
    std::exception_ptr thrown;
    bool finished = false;
};

} // namespace

service_runtime& component_parts::runtime(component& of) { return started(of.runner_).services(); }
void component_parts::add(component& to, std::shared_ptr<call_service> service) {
    started(to.runner_).add(std::move(service));
}
void component_parts::add(component& to, std::shared_ptr<publication_core> service) {
    started(to.runner_).add(std::move(service));
}
void component_parts::withdraw(component& from, const std::string& name) {
    started(from.runner_).withdraw_service(name);
}
void component_parts::declare_required(component& by, const std::string& name, const packet_types& types) {
    started(by.runner_).declare_required(name, types);
}

task<> component_parts::run_elsewhere(component& self, unique_function<void()> job) {
    auto& runner = started(self.runner_);
    auto done = std::make_shared<offloaded>(runner.on());
    done->job = std::move(job);
    runner.env().offload([done, gate = runner.on().gate(), running = runner.begin_job()]() mutable {
        try {
            done->job();
        } catch (...) {
            done->thrown = std::current_exception();
        }
        done->job = {};
        gate->post([done = std::move(done)] { // this thread keeps nothing of what was thrown
            done->finished = true;
            done->wake.resume();
        });
        running.reset(); // the component may be destroyed from now on
    });
    while (!done->finished) co_await done->wake.wait();
    if (done->thrown) std::rethrow_exception(done->thrown);
}

void component_parts::post_spawn(component& on, std::string name, task<> body) {
    on.on().gate()->post(
        [self = on.runner_->shared_from_this(), name = std::move(name), body = std::move(body)]() mutable {
            auto taken = std::move(body);
            self->flow().spawn(std::move(name), std::move(taken));
        });
}

void component_parts::throw_outcome(component& of, const std::exception_ptr& thrown) {
    bool gone = false;
    try {
        std::rethrow_exception(thrown);
    } catch (const outcome_dropped&) {
        gone = true; // destroyed before it ended
    } catch (const std::system_error& cancelled) {
        gone = cancelled.code() == asio::error::operation_aborted && of.runner_->stop_asked();
        if (!gone) throw;
    }
    throw error(errc::cancelled, fmt::format("'{}' was stopped while a thread waited for it", of.path()),
                execution::unknown);
}

void component_parts::check_period(duration period) {
    if (period <= duration{}) throw error(errc::invalid_argument, "a period must be longer than nothing");
}

bool component_parts::keeps_trying(const failure& why) noexcept {
    return why.code() == errc::timed_out || why.code() == errc::peer_lost || why.code() == errc::unreachable;
}

void component_parts::check_may_block(component& on) {
    auto& runner = started(on.runner_);
    if (runner.state() == component_state::stopped || runner.state() == component_state::failed)
        throw error(errc::cancelled, fmt::format("'{}' has stopped", runner.path()));
    if (runner.env().is_virtual())
        throw error(errc::would_block_self,
                    "a blocking wait in the virtual world would stop its only thread: co_await instead");
    if (runner.on().running_here())
        throw error(
            errc::would_block_self,
            fmt::format("a blocking wait on the own thread of '{}' would never end: co_await instead", runner.path()));
}

} // namespace detail
} // namespace ise
