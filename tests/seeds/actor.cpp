// What an actor provides, and its flow.
#include "actor.hpp"

#include "actor_calls.hpp"
#include "actor_subscriptions.hpp"

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
    if (plan_.later_version) {
        provide_calls(calls_later);
        spawn("publishes", publishes(later_beats));
    } else {
        provide_calls(calls_now);
        spawn("publishes", publishes(beats));
    }
    for (std::uint32_t n = 0; n < plan_.callers; ++n) spawn("calls", calls(n));
    for (std::size_t n = 0; n < plan_.subscribes.size(); ++n) {
        const auto& one = plan_.subscribes[n];
        if (one.later_version) {
            spawn("subscribes", subscribes(later_beats, one, n));
        } else {
            spawn("subscribes", subscribes(beats, one, n));
        }
    }
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

template <class Services>
void actor::provide_calls(const Services& services) {
    using request = typename std::decay_t<decltype(services.instant)>::request_type;
    using response = typename std::decay_t<decltype(services.instant)>::response_type;
    provide(services.instant, [this](request asked) { return answer_now<request, response>(asked); });
    provide(services.working, [this](request asked, const ise::call_context& context) { return handle<request, response>(std::move(asked), context); });
    provide_exclusive(services.alone, [this](request asked, const ise::call_context& context) { return handle<request, response>(std::move(asked), context); });
}

template <class Request, class Response>
Response actor::answer_now(const Request& asked) {
    stage_.calls.run_began(asked.id, path());
    if (asked.fail) throw std::runtime_error("as it was asked to");
    stage_.calls.run_ended(asked.id);
    Response made;
    made.id = asked.id;
    made.check = sum_of(asked.content);
    made.content = asked.content;
    return made;
}

template <class Request, class Response>
task<Response> actor::handle(Request asked, const ise::call_context& context) {
    census::citizen here(coroutines_);
    stage_.calls.run_began(asked.id, path());
    if (asked.work_ms > 0) co_await sleep(std::chrono::milliseconds(asked.work_ms));
    if (asked.fail) throw std::runtime_error("as it was asked to");
    if (asked.call_back) {
        goal back;
        back.name = std::string(context.caller);
        back.by_name = false;
        try {
            back.way = caller(context);
        } catch (const ise::error&) { // the session is over, and so is the call
        }
        if (back.way) {
            job small;
            small.content = {1, 2, 3};
            auto terms = terms_of("instant", back, small, inner_limit);
            terms.over_session = true;
            terms.parent = asked.id;
            terms.deadline = std::min(terms.deadline, context.deadline);
            auto got = co_await ask(calls_now.instant, back.way, terms, small, inner_limit);
        }
    }
    for (const auto& hop : asked.hops) {
        goal next;
        next.name = hop;
        next.host = host_of(stage_, hop);
        next.way = at(hop);
        job small;
        small.work_ms = 1;
        auto terms = terms_of("working", next, small, inner_limit);
        terms.parent = asked.id;
        terms.deadline = std::min(terms.deadline, context.deadline);
        auto got = co_await ask(calls_later.working, next.way, terms, small, inner_limit);
    }
    stage_.calls.run_ended(asked.id);
    Response made;
    made.id = asked.id;
    made.check = sum_of(asked.content);
    made.content = std::move(asked.content);
    co_return made;
}

} // namespace seeds
