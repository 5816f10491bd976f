#include <ise/instantiation/instantiation_server.hpp>

#include <ise/instantiation/refusal.hpp>
#include <ise/service/service_host.hpp>

#include <fmt/format.h>

namespace ise::instantiation {
namespace {
using namespace std::chrono_literals;

constexpr duration one_question = 1s;
constexpr duration first_question = 6s; // a name server that has just been started again is tried again after a pause
constexpr duration max_wait_for_name = 6s; // a lease, and the time to find out
constexpr std::size_t shown_lines = 12;

} // namespace

task<start_response> instantiation_server::start_one(start_request request) {
    start_response refused;
    try {
        auto response = co_await begin(std::move(request));
        co_return response;
    } catch (const error& why) {
        refused = refusal(why);
    }
    co_return refused;
}

task<start_response> instantiation_server::begin(start_request request) {
    check_wishes(request, options_.rules);
    auto wanted = request;
    auto what = co_await plan(std::move(wanted));
    check_process(request.process, what.program);
    check_room(what.path);
    check_rate();
    co_await check_name(what.path);
    check_room(what.path); // others may have come meanwhile
    check_endpoints(what.listen);
    auto one = remember(std::move(request), std::move(what));
    if (prints_alone(*one)) one->output->remove();
    carry_out(one, one->watch.start(now()));
    auto response = co_await until_ready(one);
    co_return response;
}

task<start_response> instantiation_server::restart_one(std::string path) {
    auto one = find(path);
    start_response refused;
    try {
        auto response = co_await begin_again(one);
        co_return response;
    } catch (const error& why) {
        refused = refusal(why);
    }
    co_return refused;
}

task<start_response> instantiation_server::begin_again(instance_ptr one) {
    check_rate();
    auto asked = one->asked;
    asked.path = one->plan.path;
    asked.name_space.clear();
    auto what = co_await plan(std::move(asked));
    one->plan = std::move(what);
    carry_out(one, one->watch.restart(now()));
    auto response = co_await until_ready(one);
    co_return response;
}

task<start_response> instantiation_server::until_ready(instance_ptr one) {
    auto life = one->life;
    try {
        while (one->watch.state() == instance_state::starting || one->watch.state() == instance_state::stopping)
            co_await next_change(on(), one);
    } catch (...) { // whoever waited has given up: it does not go on by itself
        if (one->watch.state() == instance_state::starting && !stopping_)
            carry_out(one, one->asked.process.empty()
                               ? one->watch.kill(now())
                               : one->watch.stop(now(), one->asked.terms.grace)); // others share its process
        throw;
    }
    start_response made;
    made.started = one->text();
    if (one->watch.state() == instance_state::ready) co_return made;
    bool launched = one->launched_life >= life;
    made.outcome = !launched           ? start_outcome::not_launched
                   : one->watch.late() ? start_outcome::deadline
                                       : start_outcome::exited;
    made.why = fmt::format("'{}' did not start: {}", one->plan.path, one->watch.reason());
    if (one->watch.late() && !one->obstacle.empty()) made.why += fmt::format(" ({})", one->obstacle);
    if (launched) made.output = one->output->last_lines(shown_lines);
    co_return made;
}

void instantiation_server::check_room(const std::string& path) {
    auto here = instances_.find(path);
    if (here != instances_.end() && !here->second->watch.over())
        throw error(
            errc::name_taken,
            fmt::format(
                "'{}' runs here already, as process {}: restart it, stop it first, or start another under another path",
                path, here->second->running ? here->second->running->stamp().pid : 0));
    if (here != instances_.end() || instances_.size() < options_.max_instances) return;
    auto oldest = instances_.end();
    for (auto at = instances_.begin(); at != instances_.end(); ++at)
        if (at->second->watch.over() && (oldest == instances_.end() || at->second->since < oldest->second->since))
            oldest = at;
    if (oldest == instances_.end())
        throw error(errc::overloaded, fmt::format("{} instances run here, which is the limit", instances_.size()));
    forget(oldest->first);
}

void instantiation_server::check_rate() {
    while (!starts_.empty() && now() - starts_.front() > options_.starts_window) starts_.pop_front();
    if (starts_.size() >= options_.max_starts)
        throw error(errc::overloaded,
                    fmt::format("{} components were started within {:g} s, which is the limit: try again soon",
                                starts_.size(), std::chrono::duration<double>(options_.starts_window).count()));
    starts_.push_back(now());
}

task<> instantiation_server::check_name(std::string path) {
    naming::describe_request question{path};
    auto told = co_await names_.try_call(naming::describe, std::move(question), first_question);
    if (!told) {
        if (told.error().code() == errc::no_such_name) co_return;
        throw error(errc::name_server_lost,
                    fmt::format("whether '{}' is free, and when it is ready, only the name server can tell: {}", path,
                                told.error().message()));
    }
    const auto& name = told->name;
    bool here = name.host_name == env().identity().host_name;
    if (here && !host_.alive(static_cast<std::int32_t>(name.process_id))) co_return; // its lease ends soon
    throw error(errc::name_taken, fmt::format("'{}' is held by process {} on {}, which was not started here", path,
                                              name.process_id, name.host_name));
}

void instantiation_server::check_endpoints(const std::vector<endpoint>& wanted) {
    for (const auto& at : wanted) {
        auto listening = at.kind->listen(on(), at, services().peers().credentials());
        if (!listening) throw error(listening.error());
    }
}

/// What is the same for all that is started here.
launch_order instantiation_server::order_for(const std::string& program, const output_file& printed) const {
    launch_order order;
    order.program = options_.programs_folder + "/" + program;
    order.variables = options_.variables;
    order.variables.emplace_back("ISE_NAME_SERVER", options_.name_server.text());
    order.output_file = printed.file();
    order.max_output_bytes = printed.max_bytes();
    return order;
}

/// Waits until nobody holds the name: that of a process that was killed lives as long as its lease.
task<> instantiation_server::free_name(instance_ptr one, std::uint64_t life) {
    while (freeing_.contains(one->mark)) co_await sleep(10ms); // its next life has the same mark
    auto until = saturating_add(now(), max_wait_for_name);
    while (now() < until && life == one->life && one->watch.state() == instance_state::starting) {
        naming::describe_request question{one->plan.path};
        auto told = co_await names_.try_call(naming::describe, std::move(question), one_question);
        if (!told) co_return; // free; or nobody knows, then the component finds out
        co_await sleep(100ms);
    }
}

task<> instantiation_server::launch(instance_ptr one, std::uint64_t life) {
    co_await free_name(one, life);
    if (life != one->life) co_return;
    if (one->watch.state() != instance_state::starting) {
        carry_out(one, one->watch.not_launched(now(), "it was stopped before it was started"));
        co_return;
    }
    if (one->plan.program.empty()) {
        carry_out(one, one->watch.not_launched(
                           now(), fmt::format("no program here has the type '{}' any more, or not with these arguments",
                                              one->asked.type)));
        co_return;
    }
    if (!one->asked.process.empty()) {
        co_await launch_in_process(one, life);
        co_return;
    }
    if (!std::exchange(one->mark_is_own, true) || one->mark.empty())
        one->mark = fmt::format("{:016x}{:016x}", env().random(), env().random());
    auto order = order_for(one->plan.program, *one->output);
    order.words = one->plan.words;
    order.variables.insert(order.variables.end(), one->plan.variables.begin(), one->plan.variables.end());
    order.mark = one->mark;
    order.limits = one->asked.limits;
    one->version = host_.version_of(order.program);
    one->obstacle.clear();
    auto kept = try_save(); // whoever comes after a crash finds the process by its mark
    bool first = one->launched_life == 0 && one->watch.restarts() == 0; // what ran before goes on all the same
    if (!kept && first) {
        carry_out(
            one, one->watch.not_launched(
                     now(), fmt::format(
                                "it could not be written down, and so would be lost with this instantiation server: {}",
                                kept.error().message())));
        co_return;
    }
    auto got = host_.launch(on(), order, end_handler_of(one, one->mark, life));
    if (!got) {
        carry_out(one, one->watch.not_launched(now(), got.error().message()));
        co_return;
    }
    one->running = std::move(*got);
    one->adopted = false;
    one->launched_life = life;
    one->watch.launched(now());
    save();
    carry_out(one, supervision::act::nothing);
    co_await follow_readiness(one, life);
}

task<> instantiation_server::follow_readiness(instance_ptr one, std::uint64_t life) {
    auto pause = duration(20ms);
    for (;;) {
        auto obstacle = co_await obstacle_of(one);
        if (life != one->life || one->watch.state() != instance_state::starting) co_return;
        one->obstacle = obstacle;
        if (obstacle.empty()) {
            one->watch.ready();
            carry_out(one, supervision::act::nothing);
            co_return;
        }
        co_await sleep(pause);
        pause = std::min(2 * pause, duration(200ms));
        if (life != one->life || one->watch.state() != instance_state::starting) co_return;
    }
}

/// Why it is not ready: it is when it holds its name and answers.
task<std::string> instantiation_server::obstacle_of(instance_ptr one) {
    auto mark = one->mark;
    naming::describe_request question{one->plan.path};
    auto told = co_await names_.try_call(naming::describe, std::move(question), one_question);
    if (!told)
        co_return told.error().code() == errc::no_such_name ? fmt::format("the name server does not know it yet")
                                                            : told.error().message();
    const auto& name = told->name;
    if (name.host_name != env().identity().host_name ||
        !host_.carries(static_cast<std::int32_t>(name.process_id), mark))
        co_return fmt::format("its name is held by process {} on {}", name.process_id, name.host_name);
    if (name.state != "ready") co_return fmt::format("it is registered as {}", name.state);
    auto who = at(one->plan.path);
    ise::describe_request greeting;
    auto about = co_await who.try_call(describe_service, greeting, one_question);
    if (!about) co_return fmt::format("it is registered, but does not answer: {}", about.error().message());
    if (about->process_id != name.process_id) co_return std::string("another process answers under its name");
    co_return std::string();
}

} // namespace ise::instantiation
