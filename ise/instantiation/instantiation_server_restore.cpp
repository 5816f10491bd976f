// What an instantiation server writes down, and how the next one goes on with it.
#include <ise/instantiation/instantiation_server.hpp>

#include <fmt/format.h>

namespace ise::instantiation {

result<void> instantiation_server::try_save() {
    saved_state state;
    state.boot = host_.boot();
    for (const auto& [path, one] : instances_) state.instances.push_back(one->saved());
    for (const auto& [name, one] : processes_)
        state.processes.push_back(
            {name, one->program, one->mark, one->running ? one->running->stamp() : process_stamp{}, one->version});
    auto kept = save_state(host_, state_file(), state);
    if (!kept) log().error(fmt::format("the state is not on disk: {}", kept.error().message()));
    return kept;
}

void instantiation_server::restore(const saved_state& before) {
    bool same_boot = before.boot == host_.boot();
    for (const auto& one : before.processes)
        if (same_boot) restore(one);
    for (const auto& one : before.instances) restore(one, same_boot);
    tend_processes();
    if (!before.instances.empty())
        log().info(fmt::format("goes on with {} instances of an instantiation server that ran before",
                               before.instances.size()));
}

void instantiation_server::restore(const saved_instance& before, bool same_boot) {
    auto planned = catalogue_->plan(before.asked, options_.rules, env().random());
    launch_plan what;
    if (planned) what = std::move(*planned);
    what.path = before.path;
    auto one = remember(before.asked, std::move(what));
    one->since = before.since;
    one->version = before.program_version;
    one->former = before.former;
    one->undo = before.undo;
    told_[before.path] = {before.state, before.reason};
    one->mark = before.mark;
    one->mark_is_own = before.asked.process.empty();
    bool over = before.state == instance_state::stopped || before.state == instance_state::failed;
    ++one->life;
    bool started_since = over && one->mark_is_own && adopt(one, before, same_boot); // its disk was full then
    if (over && !started_since) return one->watch.adopt_over(before.state, before.reason, before.restarts);
    bool runs = started_since ||
                (before.asked.process.empty() ? adopt(one, before, same_boot) : restore_in_process(one, before));
    if (!runs) {
        if (before.asked.process.empty()) free_names_of(before.mark);
        auto how = how_it_ended(process_end(), before.mark, *one->output);
        auto text = fmt::format("it ended while no instantiation server ran: {}",
                                same_boot ? how.text() : "the machine was started again");
        if (before.state == instance_state::stopping) {
            one->watch.adopt_over(instance_state::stopped, text, before.restarts);
            return changed(one);
        }
        return carry_out(one, one->watch.adopt_ended(now(), before.restarts, how.well(), text));
    }
    one->adopted = true;
    one->watch.adopt(now(), before.state == instance_state::ready, before.restarts);
    carry_out(one, before.state == instance_state::stopping ? one->watch.stop(now(), one->asked.terms.grace)
                                                            : supervision::act::nothing);
    if (one->watch.state() == instance_state::starting)
        spawn("readiness of " + before.path, follow_readiness(one, one->life));
}

/// What is known already, else what its keeper recorded.
process_end instantiation_server::how_it_ended(process_end told, const std::string& mark,
                                               const output_file& printed) const {
    if (told.known) return told;
    auto record = printed.status();
    bool of_it = record && record->ended && record->mark == mark;
    return of_it ? record->how : told;
}

/// Takes over the process that it has for itself. False: it has ended.
bool instantiation_server::adopt(const instance_ptr& one, const saved_instance& before, bool same_boot) {
    if (!same_boot || before.mark.empty()) return false;
    auto got = host_.adopt(on(), before.process, before.mark, end_handler_of(one, before.mark, one->life));
    if (got) one->running = std::move(*got);
    return got.has_value();
}

} // namespace ise::instantiation
