// An actor's flow.
#include "actor.hpp"

#include <stdexcept>

namespace seeds {

using namespace std::chrono_literals;
using ise::task;

actor::actor(stage& of, const component_plan& plan, std::string host, std::uint64_t life)
    : stage_(of), plan_(plan), host_(std::move(host)), life_(life), coroutines_(of.coroutines[life]) {
    stage_.actors.push_back(this);
}

actor::~actor() {
    std::erase(stage_.actors, this);
    if (failing_) stage_.sky.end(host_, stage_.world.now());
}

task<> actor::run() {
    census::citizen here(coroutines_);
    ++flows_;
    if (std::exchange(failing_, false)) stage_.sky.end(host_, now());
    provide_calls();
    spawn("publishes", publishes());
    for (std::uint32_t n = 0; n < plan_.callers; ++n) spawn("calls", calls(n));
    for (std::size_t n = 0; n < plan_.subscribes.size(); ++n) spawn("subscribes", subscribes(plan_.subscribes[n], n));
    if (plan_.fails) spawn("fails", fails());
    co_await ready();
    co_await sleep(1000h);
}

task<> actor::fails() {
    census::citizen here(coroutines_);
    ise::sim::generator draw(stage_.plan.seed, fmt::format("failure of {} {} {}", path(), life_, flows_));
    co_await sleep(ise::duration(2s) + ise::duration(static_cast<ise::duration::rep>(draw.below(10'000'000'000u))));
    if (stage_.now != phase::stormy || failures_ >= 2) co_return;
    ++failures_;
    failing_ = true;
    stage_.sky.begin(host_);
    stage_.events.note("{} fails", path());
    stage_.events.tally("flows that failed");
    throw std::runtime_error("as planned");
}

} // namespace seeds
