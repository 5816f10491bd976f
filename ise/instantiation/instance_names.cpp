#include <ise/component/introspection.hpp>
#include <ise/instantiation/instance_names.hpp>
#include <ise/naming/services.hpp>

#include <fmt/format.h>

#include <algorithm>

namespace ise::instantiation {
namespace {
using namespace std::chrono_literals;

constexpr duration one_question = 1s;
constexpr duration first_question = 6s; // a name server that has just been started again is tried again after a pause
constexpr duration max_wait_for_name = 6s; // a lease, and the time to find out

bool is_starting(const instance& one, std::uint64_t life) {
    return life == one.life && one.watch.state() == instance_state::starting;
}

} // namespace

task<> instance_names::check_free(std::string path) {
    naming::describe_request question{path};
    auto response = co_await name_server_.try_call(naming::describe, std::move(question), first_question);
    if (!response) {
        if (response.error().code() == errc::no_such_name) co_return;
        throw error(errc::name_server_lost,
                    fmt::format("whether '{}' is free, and when it is ready, only the name server can tell: {}", path,
                                response.error().message()));
    }
    const auto& name = response->name;
    bool here = name.host_name == here_.self.env().identity().host_name;
    if (here && !here_.host.alive(static_cast<std::int32_t>(name.process_id))) co_return; // its lease ends soon
    throw error(errc::name_taken, fmt::format("'{}' is held by process {} on {}, which was not started here", path,
                                              name.process_id, name.host_name));
}

task<> instance_names::wait_until_free(instance_ptr one, std::uint64_t life) {
    while (freeing_.contains(one->mark)) co_await here_.self.sleep(10ms); // its next life has the same mark
    auto until = saturating_add(here_.self.now(), max_wait_for_name);
    while (here_.self.now() < until && is_starting(*one, life)) {
        naming::describe_request question{one->plan.path};
        auto response = co_await name_server_.try_call(naming::describe, std::move(question), one_question);
        if (!response) co_return; // free; or nobody knows, then the component finds out
        co_await here_.self.sleep(100ms);
    }
}

void instance_names::free_those_of(const std::string& mark) {
    if (here_.stopping || mark.empty()) return;
    freeing_.insert(mark);
    here_.self.spawn("names of the dead", free_now(mark));
}

task<> instance_names::free_now(std::string mark) {
    naming::ended_request request;
    request.launch_mark = mark;
    auto response = co_await name_server_.try_call(naming::ended, std::move(request), 2s);
    freeing_.erase(freeing_.find(mark));
    if (!response)
        here_.self.log().debug(fmt::format("names of a process that ended are free when its lease is over: {}",
                                           response.error().message()));
}

task<> instance_names::follow_readiness(instance_ptr one, std::uint64_t life) {
    auto pause = duration(20ms);
    for (;;) {
        auto obstacle = co_await obstacle_of(one);
        if (!is_starting(*one, life)) co_return;
        one->obstacle = obstacle;
        if (obstacle.empty()) {
            one->watch.ready();
            instances_.changed(one);
            co_return;
        }
        co_await here_.self.sleep(pause);
        pause = std::min(2 * pause, duration(200ms));
        if (!is_starting(*one, life)) co_return;
    }
}

/// Why it is not ready: it is when it holds its name and answers.
task<std::string> instance_names::obstacle_of(instance_ptr one) {
    auto mark = one->mark;
    naming::describe_request question{one->plan.path};
    auto response = co_await name_server_.try_call(naming::describe, std::move(question), one_question);
    if (!response)
        co_return response.error().code() == errc::no_such_name ? fmt::format("the name server does not know it yet")
                                                                : response.error().message();
    const auto& name = response->name;
    if (name.host_name != here_.self.env().identity().host_name ||
        !here_.host.carries(static_cast<std::int32_t>(name.process_id), mark))
        co_return fmt::format("its name is held by process {} on {}", name.process_id, name.host_name);
    if (name.state != "ready") co_return fmt::format("it is registered as {}", name.state);
    auto who = here_.self.at(one->plan.path);
    ise::describe_request greeting;
    auto about = co_await who.try_call(describe_service, greeting, one_question);
    if (!about) co_return fmt::format("it is registered, but does not answer: {}", about.error().message());
    if (about->process_id != name.process_id) co_return std::string("another process answers under its name");
    co_return std::string();
}

} // namespace ise::instantiation
