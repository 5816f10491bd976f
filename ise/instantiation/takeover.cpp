#include <ise/instantiation/takeover.hpp>

#include <fmt/format.h>

#include <utility>

namespace ise::instantiation {

void takeover::restore(const saved_state& before) {
    bool same_boot = before.boot == here_.host.boot();
    for (const auto& one : before.processes)
        if (same_boot) shared_.restore(one);
    for (const auto& one : before.instances) restore(one, same_boot);
    shared_.tend();
    if (!before.instances.empty())
        here_.self.log().info(fmt::format("goes on with {} instances of an instantiation server that ran before",
                                          before.instances.size()));
}

void takeover::restore(const saved_instance& before, bool same_boot) {
    launch_plan unknown;
    unknown.path = before.path;
    auto one = instances_.add(before.asked, std::move(unknown));
    auto planned = types_.known().plan(one->asked_again(), here_.options.rules, here_.self.env().random());
    if (planned) one->plan = std::move(*planned);
    one->since = before.since;
    one->version = before.program_version;
    one->former = before.former;
    one->undo = before.undo;
    instances_.published(before.path, before.state, before.reason);
    one->mark = before.mark;
    one->mark_is_own = before.asked.process.empty();
    ++one->life;
    bool over = before.state == instance_state::stopped || before.state == instance_state::failed;
    // It may have been started since, while the disk was full.
    bool runs = (!over || one->mark_is_own) && find_process(one, before, same_boot);
    if (over && !runs) return one->watch.adopt_over(before.state, before.reason, before.restarts);
    if (!runs) {
        if (one->mark_is_own) names_.free_those_of(before.mark);
        auto how = how_it_ended(process_end(), before.mark, *one->output);
        auto text = fmt::format("it ended while no instantiation server ran: {}",
                                same_boot ? how.text() : "the machine was started again");
        if (before.state == instance_state::stopping) {
            one->watch.adopt_over(instance_state::stopped, text, before.restarts);
            return instances_.changed(one);
        }
        auto next = one->watch.adopt_ended(here_.self.now(), before.restarts, how.well(), text);
        return instances_.carry_out(one, next);
    }
    one->adopted = true;
    one->watch.adopt(here_.self.now(), before.state == instance_state::ready, before.restarts);
    if (before.state == instance_state::stopping)
        instances_.carry_out(one, one->watch.stop(here_.self.now(), one->asked.terms.grace));
    else instances_.changed(one);
    if (!planned) here_.self.spawn("plan of " + before.path, processes_.plan_later(one, one->life));
    if (one->watch.state() == instance_state::starting)
        here_.self.spawn("readiness of " + before.path, names_.follow_readiness(one, one->life));
}

bool takeover::find_process(const instance_ptr& one, const saved_instance& before, bool same_boot) {
    if (!one->mark_is_own) return shared_.restore(one, before);
    return same_boot && processes_.adopt(one, before);
}

} // namespace ise::instantiation
