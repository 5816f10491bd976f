#include <ise/instantiation/common_order.hpp>
#include <ise/instantiation/launcher.hpp>
#include <ise/instantiation/refusal.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <utility>

namespace ise::instantiation {
namespace {

constexpr duration max_planning = std::chrono::seconds(30);

} // namespace

task<> launcher::launch(instance_ptr one, std::uint64_t life) {
    co_await names_.wait_until_free(one, life);
    if (life == one->life && one->plan.program.empty()) {
        // Not within the time of a launch: a busy machine must not use up the restarts.
        one->watch.launch_by(saturating_add(here_.self.now() + max_planning, 2 * one->asked.terms.ready_within));
        instances_.changed(one);
        co_await plan_later(one, life);
    }
    if (life != one->life) co_return;
    std::string why;
    if (one->watch.state() != instance_state::starting) why = "it was stopped before it was started";
    else if (one->plan.program.empty())
        why = fmt::format("no program here has the type '{}' any more, or not with these arguments", one->asked.type);
    else why = objection_to_own(one->asked, here_.options.rules); // what was taken over was allowed by other rules
    if (!why.empty()) instances_.carry_out(one, one->watch.not_launched(here_.self.now(), why));
    else if (one->asked.process.empty()) co_await launch_alone(one, life);
    else co_await shared_.launch(one, life);
}

task<> launcher::plan_later(instance_ptr one, std::uint64_t life) {
    auto until = here_.self.now() + max_planning;
    auto still = [&] { return life == one->life && one->plan.program.empty() && !one->watch.over(); };
    while (still() && here_.self.now() < until) {
        co_await types_.refresh();
        auto planned = types_.known().plan(one->asked_again(), here_.options.rules, here_.self.env().random());
        if (planned && still()) {
            one->plan = std::move(*planned);
            instances_.changed(one); // it may have a probe now
        }
        if (planned || types_.known().problems().empty()) co_return;
        co_await here_.self.sleep(std::chrono::seconds(1));
    }
}

task<> launcher::launch_alone(instance_ptr one, std::uint64_t life) {
    if (!std::exchange(one->mark_is_own, true) || one->mark.empty())
        one->mark = fmt::format("{:016x}{:016x}", here_.self.env().random(), here_.self.env().random());
    auto order = common_order(here_.options, one->plan.program, *one->output);
    order.words = one->plan.words;
    order.variables.insert(order.variables.end(), one->plan.variables.begin(), one->plan.variables.end());
    order.mark = one->mark;
    order.limits = one->asked.limits;
    order.user = one->asked.user;
    if (!one->asked.identity.empty()) {
        std::erase_if(order.variables, [](const auto& variable) { return variable.first == "ISE_TLS"; });
        order.variables.emplace_back("ISE_TLS", here_.options.rules.identities_folder + "/" + one->asked.identity);
    }
    one->version = here_.host.version_of(order.program);
    one->obstacle.clear();
    auto kept = state_.try_save(); // whoever comes after a crash finds the process by its mark
    bool first = one->launched_life == 0 && one->watch.restarts() == 0; // what ran before goes on all the same
    if (!kept && first) {
        auto why = fmt::format("it could not be written down, and so would be lost with this instantiation server: {}",
                               kept.error().message());
        instances_.carry_out(one, one->watch.not_launched(here_.self.now(), why));
        co_return;
    }
    auto got = here_.host.launch(here_.self.on(), order, end_handler_of(one, one->mark, life));
    if (!got) {
        instances_.carry_out(one, one->watch.not_launched(here_.self.now(), got.error().message()));
        co_return;
    }
    one->running = std::move(*got);
    one->adopted = false;
    one->launched_life = life;
    one->watch.launched(here_.self.now());
    state_.save();
    instances_.changed(one);
    co_await names_.follow_readiness(one, life);
}

machine::end_handler launcher::end_handler_of(const instance_ptr& one, const std::string& mark, std::uint64_t life) {
    return [this, weak = std::weak_ptr<instance>(one), mark, life](process_end how) {
        names_.free_those_of(mark);
        if (auto held = weak.lock()) instances_.ended(held, life, how);
    };
}

bool launcher::adopt(const instance_ptr& one, const saved_instance& before) {
    if (before.mark.empty()) return false;
    auto got =
        here_.host.adopt(here_.self.on(), before.process, before.mark, end_handler_of(one, before.mark, one->life));
    if (got) one->running = std::move(*got);
    return got.has_value();
}

} // namespace ise::instantiation
