#include <ise/component/component.hpp>

#include <ise/component/component_runner.hpp>
#include <ise/service/session.hpp>

#include <fmt/format.h>

namespace ise {

std::string_view name_of(component_state state) noexcept {
    switch (state) {
        case component_state::starting: return "starting";
        case component_state::ready: return "ready";
        case component_state::stopping: return "stopping";
        case component_state::stopped: return "stopped";
        case component_state::failed: return "failed";
    }
    return "?";
}

namespace {

component_runner& started(component_runner* runner) {
    if (!runner) throw error(errc::invalid_argument, "a component is used before it was started: do it in run(), not in the constructor");
    return *runner;
}

} // namespace

component::component() = default;
component::~component() = default;

const std::string& component::path() const noexcept { return runner_->path(); }
environment& component::env() const noexcept { return runner_->env(); }
loop& component::on() const noexcept { return runner_->on(); }
asio::any_io_executor component::get_executor() const { return started(runner_).on().get_executor(); }
const logger& component::log() const noexcept { return runner_->log(); }
component_state component::state() const noexcept { return runner_ ? runner_->state() : component_state::starting; }
service_host& component::services() const noexcept { return runner_->services(); }

void component::add(std::shared_ptr<call_service> service) { started(runner_).add(std::move(service)); }
void component::add(std::shared_ptr<publication_core> service) { started(runner_).add(std::move(service)); }
void component::withdraw_service(const std::string& name) { started(runner_).withdraw_service(name); }
void component::declare_required(const std::string& name, const packet_types& types) { started(runner_).declare_required(name, types); }

task<remote> component::find(std::string path, duration wait) {
    auto& services = started(runner_).services();
    auto found = services.link_to(path);
    auto* names = services.resolver();
    if (!names)
        throw error(errc::invalid_argument, fmt::format("'{}' cannot be found: this component has no name server; use at(endpoint)", path));
    auto until = saturating_add(on().now(), wait);
    auto place = co_await names->resolve_when_present(path, until);
    place.value();
    co_return remote(std::move(found));
}

remote component::at(const std::string& path) { return remote(started(runner_).services().link_to(path)); }
remote component::at(const endpoint& where) { return remote(started(runner_).services().link_to(where)); }

remote component::caller(const call_context& context) {
    auto& services = started(runner_).services();
    for (const auto& [raw, held] : services.sessions())
        if (held->peer_name().data() == context.caller.data()) return remote(std::make_shared<link>(services, held));
    throw error(errc::peer_lost, fmt::format("the session with {} has ended", context.caller));
}

void component::spawn(std::string name, task<> body) { started(runner_).flow().spawn(std::move(name), std::move(body)); }
task<> component::ready() { return started(runner_).ready(); }
void component::stop() { started(runner_).stop(); }

void component::check_may_block() const {
    auto& runner = started(runner_);
    if (runner.env().is_virtual()) throw error(errc::would_block_self, "a blocking wait in the virtual world would stop its only thread: co_await instead");
    if (runner.on().running_here())
        throw error(errc::would_block_self, fmt::format("a blocking wait on the own thread of '{}' would never end: co_await instead", runner.path()));
}

} // namespace ise
