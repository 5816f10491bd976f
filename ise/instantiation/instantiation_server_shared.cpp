// Instances that share a process: it is started with the first of them, and ends with the last.
#include <ise/instantiation/instantiation_server.hpp>

#include <ise/component/process_services.hpp>

#include <fmt/format.h>

#include <algorithm>

namespace ise::instantiation {
namespace {

using namespace std::chrono_literals;

constexpr duration one_answer = 5s;
constexpr duration look_pause = 100ms;
constexpr duration thread_grace = 2s;  // of a component that is to end at once
constexpr duration process_grace = 8s; // its node's own limits come first
constexpr std::size_t max_socket_path = 107;

} // namespace

endpoint instantiation_server::control_of(const std::string& process) const {
    endpoint made;
    made.kind = protocol::local;
    made.path = fmt::format("{}/process-{}.sock", options_.state_folder, process);
    if (made.path.size() > max_socket_path)
        throw error(errc::invalid_argument, fmt::format("'{}' is too long for the path of a socket, of which {} bytes "
                                                        "are allowed: choose a shorter name, or another --state",
                                                        made.path, max_socket_path));
    return made;
}

void instantiation_server::check_process(const std::string& process, const std::string& program) {
    if (process.empty()) return;
    control_of(process);
    for (const auto& [path, one] : instances_)
        if (one->asked.process == process && !one->watch.over() && one->plan.program != program)
            throw error(errc::invalid_argument,
                        fmt::format("the process '{}' runs {}, of which '{}' is one: what {} has needs another",
                                    process, one->plan.program, path, program));
}

std::shared_ptr<shared_process> instantiation_server::process_of(const instance& one) const {
    auto found = processes_.find(one.asked.process);
    return found == processes_.end() ? nullptr : found->second;
}

/// Gives the process, and starts it if need be. Throws why it cannot.
std::shared_ptr<shared_process> instantiation_server::open_process(const instance_ptr& one) {
    const auto& name = one->asked.process;
    if (auto found = process_of(*one)) return found;
    auto made = std::make_shared<shared_process>();
    made->name = name;
    made->program = one->plan.program;
    made->control = control_of(name);
    made->mark = fmt::format("{:016x}{:016x}", env().random(), env().random());
    made->output = one->output;
    auto order = order_for(made->program, *made->output);
    order.words = {"host", "--control=" + made->control.text()};
    order.mark = made->mark;
    made->version = host_.version_of(order.program);
    processes_[name] = made;
    auto kept = try_save(); // whoever comes after a crash finds the process by its mark
    auto got =
        kept ? host_.launch(on(), order, process_end_handler(made)) : result<std::unique_ptr<process>>(kept.error());
    if (!got) {
        processes_.erase(name);
        throw error(got.error());
    }
    made->running = std::move(*got);
    watch_process(made);
    return made;
}

void instantiation_server::watch_process(const std::shared_ptr<shared_process>& what) {
    what->host = at(what->control);
    spawn("process " + what->name, follow_process(what));
}

machine::end_handler instantiation_server::process_end_handler(const std::shared_ptr<shared_process>& of) {
    return [this, weak = std::weak_ptr<shared_process>(of)](process_end how) {
        auto held = weak.lock();
        if (!held) return;
        held->over = true;
        free_names_of(held->mark);
        how = how_it_ended(std::move(how), held->mark, *held->output);
        held->running.reset();
        host_.remove(held->control.path);
        if (auto found = processes_.find(held->name); found != processes_.end() && found->second == held)
            processes_.erase(found);
        how.told = fmt::format("its process '{}' ended: {}", held->name, how.text());
        for (auto& [path, member] : std::exchange(held->members, {}))
            if (auto one = member.who.lock()) on_end(one, member.life, how);
        save();
    };
}

task<> instantiation_server::launch_in_process(instance_ptr one, std::uint64_t life) {
    auto still = [&] { return life == one->life && one->watch.state() == instance_state::starting; };
    for (auto there = process_of(*one); there && (there->ending || there->outdated) && still();
         there = process_of(*one))
        co_await sleep(look_pause / 5);
    if (life != one->life) co_return;
    std::shared_ptr<shared_process> where;
    std::string why;
    if (!still()) why = "it was stopped before it was started";
    try {
        if (why.empty()) where = open_process(one);
    } catch (const error& thrown) {
        why = thrown.what();
    }
    if (!why.empty()) {
        carry_out(one, one->watch.not_launched(now(), why));
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
    auto told = co_await where->host.try_call(process_host::start, std::move(order), one->asked.terms.ready_within);
    auto found = where->members.find(path);
    bool here = !where->over && found != where->members.end() && found->second.life == life;
    if (life != one->life || !here) co_return; // it has ended, and so did its process
    bool wanted = one->watch.state() == instance_state::starting || one->watch.state() == instance_state::stopping;
    if (!told || !wanted) {
        where->members.erase(found);
        if (!told && told.error().code() != errc::refused) where->running->kill(); // whatever it is doing
        if (told) stop_in_process(where, path);
        if (wanted) carry_out(one, one->watch.not_launched(now(), told.error().message()));
        else tend_processes();
        co_return;
    }
    found->second.number = told->number;
    found->second.confirmed = true;
    bool stopping = one->watch.state() == instance_state::stopping;
    one->running = hold_component(where, path);
    one->adopted = false;
    one->launched_life = life;
    one->watch.launched(now());
    save();
    carry_out(one, stopping ? supervision::act::terminate : supervision::act::nothing);
    if (!stopping) co_await follow_readiness(one, life);
}

std::unique_ptr<process> instantiation_server::hold_component(const std::shared_ptr<shared_process>& where,
                                                              const std::string& path) {
    auto stop = [this, where, path] { stop_in_process(where, path); };
    auto kill = [this, where, path] {
        stop_in_process(where, path);
        auto found = where->members.find(path);
        if (found != where->members.end()) spawn("end of " + path, kill_if_stuck(where, path, found->second.life));
    };
    return std::make_unique<shared_component>(where->running->stamp(), stop, kill);
}

void instantiation_server::stop_in_process(const std::shared_ptr<shared_process>& where, const std::string& path) {
    auto asking = [](remote host, std::string who) -> task<> {
        process_host::stop_request what;
        what.path = std::move(who);
        auto told = co_await host.try_call(process_host::stop, std::move(what), one_answer);
    };
    spawn("stop of " + path, asking(where->host, path));
}

/// A thread cannot be killed: what does not come back takes its process along.
task<> instantiation_server::kill_if_stuck(std::shared_ptr<shared_process> where, std::string path,
                                           std::uint64_t life) {
    co_await sleep(thread_grace);
    auto found = where->members.find(path);
    if (where->over || found == where->members.end() || found->second.life != life) co_return;
    log().warning(fmt::format("{} does not end: its process '{}' is killed, with {} components", path, where->name,
                              where->members.size()));
    where->running->kill();
}

/// Looks again and again what has become of those that run there.
task<> instantiation_server::follow_process(std::shared_ptr<shared_process> where) {
    while (!where->over) {
        process_host::components_request what;
        auto told = co_await where->host.try_call(process_host::components, what, one_answer);
        if (told && !where->over) take_in(*where, *told);
        co_await sleep(look_pause);
    }
}

void instantiation_server::take_in(shared_process& of, const process_host::components_response& told) {
    std::vector<std::pair<shared_process::member, process_end>> ended;
    bool stuck = false;
    for (auto& [path, member] : of.members) {
        if (!member.confirmed) continue;
        auto found = std::ranges::find(told.components, path, &process_host::hosted::path);
        bool known = found != told.components.end();
        if (known && member.number == 0) member.number = found->number;
        if (known && found->number < member.number) continue; // that was told before it was started
        bool lives = known && found->number == member.number && !found->over;
        if (lives) continue;
        stuck = stuck || (known && found->stuck);
        process_end how;
        how.known = true;
        how.number = known && found->failure.empty() ? 0 : 1;
        how.told = !known                   ? "its process does not know it any more"
                   : found->failure.empty() ? fmt::format("ended without a failure, in process '{}'", of.name)
                                            : found->failure;
        ended.emplace_back(member, std::move(how));
    }
    for (auto& [member, how] : ended) {
        auto one = member.who.lock();
        if (!one) continue;
        of.members.erase(one->plan.path);
        on_end(one, member.life, std::move(how));
    }
    if (stuck && of.running) of.running->kill(); // a thread of it goes on for nobody
}

/// Ends processes that nobody needs any more.
void instantiation_server::tend_processes() {
    for (const auto& [name, what] : processes_) {
        bool needed = what->outdated ? !what->members.empty() : std::ranges::any_of(instances_, [&](const auto& one) {
            return one.second->asked.process == name && !one.second->watch.over();
        });
        if (needed || what->ending || !what->running) continue;
        what->ending = true;
        what->running->terminate();
        auto waiting = [](component& self, std::shared_ptr<shared_process> which) -> task<> {
            co_await self.sleep(process_grace);
            if (which->running) which->running->kill();
        };
        spawn("end of process " + name, waiting(*this, what));
    }
}

/// All that runs in the process of an instance is started again, in one of the program as it is now.
void instantiation_server::replace_process_of(const instance& one) {
    auto where = process_of(one);
    if (!where) return;
    where->outdated = true;
    auto members = where->members; // whatever becomes of them
    for (const auto& [path, member] : members) {
        auto other = member.who.lock();
        if (other && other.get() != &one && !other->watch.over()) carry_out(other, other->watch.restart(now()));
    }
}

void instantiation_server::restore(const saved_process& before) {
    auto made = std::make_shared<shared_process>();
    made->name = before.name;
    made->program = before.program;
    made->mark = before.mark;
    made->version = before.program_version;
    made->control = control_of(before.name);
    made->output = output_of({}, before.name);
    auto got = host_.adopt(on(), before.process, before.mark, process_end_handler(made));
    if (!got) return;
    made->running = std::move(*got);
    processes_[before.name] = made;
    watch_process(made);
}

bool instantiation_server::restore_in_process(const instance_ptr& one, const saved_instance& before) {
    auto where = process_of(*one);
    if (!where || where->mark != before.mark) return false;
    auto& member = where->members[before.path];
    member.who = one;
    member.life = one->life;
    member.confirmed = true;
    one->running = hold_component(where, before.path);
    return true;
}

} // namespace ise::instantiation
