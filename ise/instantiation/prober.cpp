#include <ise/instantiation/probe.hpp>
#include <ise/instantiation/prober.hpp>

#include <fmt/format.h>

#include <algorithm>

namespace ise::instantiation {
namespace {

using namespace std::chrono_literals;

constexpr duration max_answer = 5s;
constexpr duration probe_look_pause = 20ms;

struct probe_attempt {
    bool over = false;
    result<void> outcome;
};

task<> attempt(component& self, probe_target target, duration limit, std::shared_ptr<probe_attempt> into) {
    into->outcome = co_await probe(self.on(), std::move(target), limit);
    into->over = true;
}

} // namespace

void prober::begin(const instance_ptr& one) {
    bool due = one->watch.state() == instance_state::ready && one->plan.probe && one->probed_life != one->life;
    if (!due) return;
    one->probed_life = one->life;
    here_.self.spawn("probe of " + one->plan.path, follow(one, one->life));
}

task<> prober::follow(instance_ptr one, std::uint64_t life) {
    auto lives = [&] { return life == one->life && one->watch.state() == instance_state::ready && one->plan.probe; };
    std::uint32_t failures = 0;
    while (lives()) {
        auto began = here_.self.now();
        auto terms = one->asked.terms;
        auto target = *one->plan.probe;
        auto limit = std::min(terms.probe_every, max_answer);
        auto state = std::make_shared<probe_attempt>();
        here_.self.spawn("probe", attempt(here_.self, std::move(target), limit, state));
        // A connection may take the system minutes: then it has failed, and no other is tried meanwhile.
        while (!state->over && here_.self.now() < saturating_add(began, limit + probe_look_pause))
            co_await here_.self.sleep(probe_look_pause);
        if (!lives()) break;
        std::string why;
        if (!state->over) why = fmt::format("no answer within {:g} s", std::chrono::duration<double>(limit).count());
        else if (!state->outcome) why = state->outcome.error().message();
        failures = why.empty() ? 0 : failures + 1;
        one->probe_trouble = why.empty()
                                 ? std::string()
                                 : fmt::format("its probe {} failed{}: {}", terms.probe,
                                               failures == 1 ? "" : fmt::format(" {} times on end", failures), why);
        if (failures == 1) here_.self.log().warning(fmt::format("{}: {}", one->plan.path, one->probe_trouble));
        if (failures >= terms.probe_failures)
            instances_.carry_out(one, one->watch.unhealthy(here_.self.now(), one->probe_trouble));
        while (!state->over && lives()) co_await here_.self.sleep(probe_look_pause);
        if (lives()) co_await here_.self.sleep_till(saturating_add(began, terms.probe_every));
    }
    if (life == one->life) {
        one->probe_trouble.clear();
        one->probed_life = 0;
    }
}

} // namespace ise::instantiation
