#include <ise/instantiation/common_order.hpp>
#include <ise/instantiation/shared_processes.hpp>

#include <fmt/format.h>

#include <algorithm>

namespace ise::instantiation {
namespace {

using namespace std::chrono_literals;

constexpr duration one_answer = 5s;
constexpr duration least_start_wait = 10s; // starts in a process wait for one another
constexpr duration look_pause = 100ms;
constexpr duration thread_grace = 2s;  // of a component that is to end at once
constexpr duration process_grace = 8s; // its node's own limits come first
constexpr std::size_t max_socket_path = 107;

} // namespace

endpoint shared_processes::control_of(const std::string& process) const {
    endpoint made;
    made.kind = protocol::local;
    made.path = fmt::format("{}/process-{}.sock", here_.options.state_folder, process);
    if (made.path.size() > max_socket_path)
        throw error(errc::invalid_argument, fmt::format("'{}' is too long for the path of a socket, of which {} bytes "
                                                        "are allowed: choose a shorter name, or another --state",
                                                        made.path, max_socket_path));
    return made;
}

void shared_processes::check(const std::string& process, const std::string& program) const {
    if (process.empty()) return;
    control_of(process);
    for (const auto& [path, one] : table_.instances())
        if (one->asked.process == process && !one->watch.over() && one->plan.program != program)
            throw error(errc::invalid_argument,
                        fmt::format("the process '{}' runs {}, of which '{}' is one: what {} has needs another",
                                    process, one->plan.program, path, program));
}

/// The process of an instance, which is started if need be. Throws why it cannot.
shared_process_ptr shared_processes::open(const instance_ptr& one) {
    const auto& name = one->asked.process;
    if (auto found = table_.process_of(*one)) return found;
    auto made = std::make_shared<shared_process>();
    made->name = name;
    made->program = one->plan.program;
    made->control = control_of(name);
    made->mark = fmt::format("{:016x}{:016x}", here_.self.env().random(), here_.self.env().random());
    made->output = one->output;
    auto order = common_order(here_.options, made->program, *made->output);
    order.words = {"host", "--control=" + made->control.text()};
    order.mark = made->mark;
    made->version = here_.host.version_of(order.program);
    table_.add(made);
    auto kept = state_.try_save(); // whoever comes after a crash finds the process by its mark
    auto got = kept ? here_.host.launch(here_.self.on(), order, end_handler_of(made))
                    : result<std::unique_ptr<process>>(kept.error());
    if (!got) {
        table_.remove(made);
        throw error(got.error());
    }
    made->running = std::move(*got);
    watch(made);
    return made;
}

void shared_processes::watch(const shared_process_ptr& process) {
    process->host = here_.self.at(process->control);
    here_.self.spawn("process " + process->name, follow(process));
}

machine::end_handler shared_processes::end_handler_of(const shared_process_ptr& process) {
    return [this, weak = std::weak_ptr<shared_process>(process)](process_end how) {
        auto held = weak.lock();
        if (!held) return;
        held->over = true;
        names_.free_those_of(held->mark);
        how = how_it_ended(std::move(how), held->mark, *held->output);
        held->running.reset();
        here_.host.remove(held->control.path);
        table_.remove(held);
        how.reason = fmt::format("its process '{}' ended: {}", held->name, how.text());
        for (auto& [path, member] : std::exchange(held->members, {}))
            if (auto one = member.who.lock()) instances_.ended(one, member.life, how);
        state_.save();
    };
}

task<> shared_processes::launch(instance_ptr one, std::uint64_t life) {
    auto still = [&] { return life == one->life && one->watch.state() == instance_state::starting; };
    for (auto there = table_.process_of(*one); there && (there->ending || there->outdated) && still();
         there = table_.process_of(*one))
        co_await here_.self.sleep(look_pause / 5);
    if (life != one->life) co_return;
    shared_process_ptr where;
    std::string why;
    if (!still()) why = "it was stopped before it was started";
    try {
        if (why.empty()) where = open(one);
    } catch (const error& thrown) {
        why = thrown.what();
    }
    if (!why.empty()) {
        instances_.carry_out(one, one->watch.not_launched(here_.self.now(), why));
        co_return;
    }
    one->mark = where->mark;
    one->mark_is_own = false;
    one->version = where->version;
    one->obstacle.clear();
    auto path = one->plan.path;
    auto& member = where->members[path];
    member = {};
    member.who = one;
    member.life = life;
    process_host::start_request order;
    order.words.assign(one->plan.words.begin() + 1, one->plan.words.end());
    auto wait = std::max(one->asked.terms.ready_within, least_start_wait);
    auto response = co_await where->host.try_call(process_host::start, std::move(order), wait);
    auto found = where->members.find(path);
    bool here = !where->over && found != where->members.end() && found->second.life == life;
    if (life != one->life || !here) co_return; // it has ended, and so did its process
    bool wanted = one->watch.state() == instance_state::starting || one->watch.state() == instance_state::stopping;
    if (!response || !wanted) {
        where->members.erase(found); // what may run there for nobody is found by `compare`
        bool unclear = !response && response.error().code() != errc::refused;
        if (unclear && where->members.empty()) where->running->kill(); // whatever it is doing
        if (wanted) instances_.carry_out(one, one->watch.not_launched(here_.self.now(), response.error().message()));
        else tend();
        co_return;
    }
    found->second.number = response->number;
    found->second.confirmed = true;
    bool stopping = one->watch.state() == instance_state::stopping;
    one->running = hold(where, path);
    one->adopted = false;
    one->launched_life = life;
    one->watch.launched(here_.self.now());
    state_.save();
    instances_.carry_out(one, stopping ? supervision::act::terminate : supervision::act::nothing);
    if (!stopping) co_await names_.follow_readiness(one, life);
}

std::unique_ptr<process> shared_processes::hold(const shared_process_ptr& where, const std::string& path) {
    auto stop = [this, where, path] { stop_in(where, path); };
    auto kill = [this, where, path] {
        stop_in(where, path);
        auto found = where->members.find(path);
        if (found != where->members.end())
            here_.self.spawn("end of " + path, kill_if_stuck(where, path, found->second.life));
    };
    return std::make_unique<shared_component>(where->running->stamp(), stop, kill);
}

void shared_processes::stop_in(const shared_process_ptr& where, const std::string& path) {
    auto asking = [](remote host, std::string who) -> task<> {
        process_host::stop_request what;
        what.path = std::move(who);
        auto response = co_await host.try_call(process_host::stop, std::move(what), one_answer);
    };
    here_.self.spawn("stop of " + path, asking(where->host, path));
}

/// A thread cannot be killed: what does not come back takes its process along.
task<> shared_processes::kill_if_stuck(shared_process_ptr where, std::string path, std::uint64_t life) {
    co_await here_.self.sleep(thread_grace);
    auto found = where->members.find(path);
    if (where->over || found == where->members.end() || found->second.life != life) co_return;
    here_.self.log().warning(fmt::format("{} does not end: its process '{}' is killed, with {} components", path,
                                         where->name, where->members.size()));
    where->running->kill();
}

/// Looks again and again what has become of those that run there.
task<> shared_processes::follow(shared_process_ptr where) {
    while (!where->over) {
        process_host::components_request what;
        auto response = co_await where->host.try_call(process_host::components, what, one_answer);
        if (response && !where->over) compare(where, *response);
        co_await here_.self.sleep(look_pause);
    }
}

void shared_processes::compare(const shared_process_ptr& where, const process_host::components_response& result) {
    auto& of = *where;
    std::vector<std::pair<shared_process::member, process_end>> ended;
    bool stuck = false;
    for (auto& [path, member] : of.members) {
        if (!member.confirmed) continue;
        auto found = std::ranges::find(result.components, path, &process_host::hosted::path);
        bool known = found != result.components.end();
        if (known && member.number == 0) member.number = found->number;
        if (known && found->number < member.number) continue; // that was told before it was started
        bool lives = known && found->number == member.number && !found->over;
        if (lives) continue;
        stuck = stuck || (known && found->stuck);
        process_end how;
        how.known = true;
        how.number = known && found->failure.empty() ? 0 : 1;
        how.reason = !known                   ? "its process does not know it any more"
                     : found->failure.empty() ? fmt::format("ended without a failure, in process '{}'", of.name)
                                              : found->failure;
        ended.emplace_back(member, std::move(how));
    }
    for (auto& [member, how] : ended) {
        auto one = member.who.lock();
        if (!one) continue;
        of.members.erase(one->plan.path);
        instances_.ended(one, member.life, std::move(how));
    }
    for (const auto& each : result.components) // its start was given up before it was answered
        if (!each.over && !of.members.contains(each.path)) stop_in(where, each.path);
    if (stuck && of.running) of.running->kill(); // a thread of it goes on for nobody
}

void shared_processes::tend() {
    for (const auto& [name, what] : table_.processes()) {
        bool needed =
            what->outdated ? !what->members.empty() : std::ranges::any_of(table_.instances(), [&](const auto& one) {
                return one.second->asked.process == name && !one.second->watch.over();
            });
        if (needed || what->ending || !what->running) continue;
        what->ending = true;
        what->running->terminate();
        auto waiting = [](component& self, shared_process_ptr which) -> task<> {
            co_await self.sleep(process_grace);
            if (which->running) which->running->kill();
        };
        here_.self.spawn("end of process " + name, waiting(here_.self, what));
    }
}

void shared_processes::replace_that_of(const instance& one) {
    auto where = table_.process_of(one);
    if (!where) return;
    where->outdated = true;
    auto members = where->members; // whatever becomes of them
    for (const auto& [path, member] : members) {
        auto other = member.who.lock();
        if (other && other.get() != &one && !other->watch.over())
            instances_.carry_out(other, other->watch.restart(here_.self.now()));
    }
}

void shared_processes::restore(const saved_process& before) {
    auto made = std::make_shared<shared_process>();
    made->name = before.name;
    made->program = before.program;
    made->mark = before.mark;
    made->version = before.program_version;
    made->control = control_of(before.name);
    made->output = table_.output_of({}, before.name);
    auto got = here_.host.adopt(here_.self.on(), before.process, before.mark, end_handler_of(made));
    if (!got) return;
    made->running = std::move(*got);
    table_.add(made);
    watch(made);
}

bool shared_processes::restore(const instance_ptr& one, const saved_instance& before) {
    auto where = table_.process_of(*one);
    if (!where || where->mark != before.mark) return false;
    auto& member = where->members[before.path];
    member.who = one;
    member.life = one->life;
    member.confirmed = true;
    one->running = hold(where, before.path);
    return true;
}

void shared_processes::stop() {
    for (const auto& [name, one] : table_.processes()) one->running.reset();
}

} // namespace ise::instantiation
