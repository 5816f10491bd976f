// How an actor calls others, and what it does when it is called.
#include "actor.hpp"

#include <ise/asio.hpp>

#include <asio/bind_cancellation_slot.hpp>

#include <stdexcept>

namespace seeds {

using namespace std::chrono_literals;
using ise::task;

namespace {

/// Of the calls that a handler makes.
constexpr ise::duration inner_limit = 1s;

std::string host_of(const stage& of, const std::string& path) {
    for (const auto& one : of.plan.components)
        if (one.path == path) return of.plan.processes[one.process].host;
    return {};
}

template <class To, class From>
To converted(From&& from) {
    To made;
    made.id = from.id;
    if constexpr (requires { made.hops; }) {
        made.work_ms = from.work_ms;
        made.call_back = from.call_back;
        made.fail = from.fail;
        made.hops = from.hops;
    } else {
        made.check = from.check;
    }
    made.content = from.content;
    return made;
}

/// What the biggest bursts of requests and answers take through the window of a connection, which is full of them.
ise::duration transit(const plan& of) {
    std::uint64_t most = 0;
    for (const auto& one : of.components) most = std::max<std::uint64_t>(most, one.request_bytes);
    return (60 * most / (64 * 1024)) * 2 * of.latency;
}

/// A call that is open in the ledger for as long as somebody waits for it.
class open_call {
public:
    open_call(ledger& in, call_terms terms) : ledger_(in), id_(in.open(std::move(terms))) {}
    ~open_call() {
        if (!over_) ledger_.dropped(id_);
    }
    open_call(const open_call&) = delete;
    open_call& operator=(const open_call&) = delete;

    std::uint64_t id() const noexcept { return id_; }
    bool over() const noexcept { return over_; }
    void give_up() {
        ledger_.given_up(id_);
        cancel.emit(asio::cancellation_type::terminal);
    }
    template <class Response>
    ise::result<done> outcome(const ise::result<Response>& got) {
        ise::result<done> outcome = got ? ise::result<done>(converted<done>(*got)) : ise::result<done>(got.error());
        over_ = true;
        ledger_.outcome(id_, outcome);
        return outcome;
    }

    asio::cancellation_signal cancel;

private:
    ledger& ledger_;
    std::uint64_t id_;
    bool over_ = false;
};

} // namespace

template <class Contract>
task<ise::result<done>> actor::ask(Contract service, ise::remote to, call_terms terms, job what, ise::duration limit) {
    census::citizen here(coroutines_);
    open_call mine(stage_.calls, std::move(terms));
    what.id = mine.id();
    auto packet = converted<typename Contract::request_type>(what);
    auto got = co_await to.try_call(service, packet, limit);
    co_return mine.outcome(got);
}

template <class Contract>
void actor::fire(const Contract& service, const ise::remote& to, call_terms terms, job what, ise::duration limit,
                 ise::duration patience) {
    auto mine = std::make_shared<open_call>(stage_.calls, std::move(terms));
    what.id = mine->id();
    auto heard = [mine](ise::result<typename Contract::response_type> got) {
        [[maybe_unused]] auto report = mine->outcome(got);
    };
    to.try_call(service, converted<typename Contract::request_type>(what), limit,
                asio::bind_cancellation_slot(mine->cancel.slot(), std::move(heard)));
    if (patience <= ise::duration{}) return;
    auto waits = [](ise::component& self, census& in, std::shared_ptr<open_call> call, ise::duration time) -> task<> {
        census::citizen here(in);
        co_await self.sleep(time);
        if (!call->over()) call->give_up();
    };
    spawn("patience", waits(*this, coroutines_, mine, patience));
}

call_terms actor::terms_of(std::string_view service, const goal& to, const job& what, ise::duration limit) const {
    call_terms made;
    made.service = service;
    made.caller = path();
    made.target = to.name;
    made.life = life_;
    made.from = host_;
    made.to = to.host;
    made.component = to.path;
    made.any_of = to.any_of;
    made.by_name = to.by_name;
    made.deadline = ise::saturating_add(stage_.world.now(), limit);
    auto inner = static_cast<int>(what.hops.size()) + (what.call_back ? 1 : 0);
    made.work = std::chrono::milliseconds(what.work_ms) + inner * inner_limit + transit(stage_.plan);
    made.fails = what.fail;
    made.check = sum_of(what.content);
    return made;
}

actor::goal actor::to_component(std::size_t number, bool by_name) {
    const auto& other = stage_.plan.components[number];
    goal made;
    made.host = stage_.plan.processes[other.process].host;
    made.path = other.path;
    made.by_name = by_name;
    if (by_name) {
        made.name = other.path;
        made.way = at(other.path);
    } else {
        auto where =
            ise::endpoint::parse(fmt::format("{}://{}:{}", other.over_datagrams ? "udp" : "tcp", made.host, other.port))
                .value();
        made.name = where.text();
        made.way = at(where);
    }
    return made;
}

actor::goal actor::to_role(const std::string& role) {
    goal made;
    made.name = role;
    made.way = at(role);
    made.any_of = stage_.plan.hosts_of_role(role);
    made.host = made.any_of.front();
    return made;
}

void actor::make_call(ise::sim::generator& draw, job& what, goal& to, ise::duration& limit) {
    const auto& all = stage_.plan.components;
    auto target = draw.below(all.size());
    to = to_component(target, draw.chance(0.75));
    if (const auto& role = all[target].role; !role.empty() && draw.chance(0.5)) to = to_role(role);
    limit = ise::duration(500ms) + ise::duration(static_cast<ise::duration::rep>(draw.below(8'000'000'000u)));
    if (plan_.short_deadlines && draw.chance(0.5))
        limit = ise::duration(1ms) + ise::duration(static_cast<ise::duration::rep>(draw.below(300'000'000u)));
    if (stage_.now != phase::stormy) limit = 20s;
    what.content = random_content(draw, plan_.request_bytes);
    what.fail = draw.chance(0.03);
    if (draw.chance(0.4)) what.work_ms = static_cast<std::uint32_t>(draw.below(draw.chance(0.2) ? 3000 : 60));
    what.call_back = draw.chance(0.2);
    if (draw.chance(0.2)) {
        for (auto hops = draw.below(2) + 1; hops > 0; --hops) what.hops.push_back(all[draw.below(all.size())].path);
    }
}

task<> actor::calls(std::uint32_t number) {
    census::citizen here(coroutines_);
    ise::sim::generator draw(stage_.plan.seed, fmt::format("calls of {} {} {} {}", path(), life_, flows_, number));
    ise::remote kept; // a handle is held for a while, so that its session lives between calls
    for (;;) {
        co_await sleep(ise::duration(
            static_cast<ise::duration::rep>(draw.below(static_cast<std::uint64_t>(plan_.pause.count())) + 1)));
        if (stage_.now == phase::quiet) co_return;
        job what;
        goal to;
        ise::duration limit{};
        make_call(draw, what, to, limit);
        if (draw.chance(0.3)) kept = to.way;
        bool later = draw.chance(0.3);
        auto kind = draw.below(10);
        bool waits = draw.chance(0.6);
        ise::duration patience{};
        if (stage_.now == phase::stormy && draw.chance(0.2))
            patience = ise::duration(
                static_cast<ise::duration::rep>(draw.below(static_cast<std::uint64_t>(limit.count())) + 1));
        for (auto same = draw.chance(0.1) ? draw.below(20) : 0;; --same) { // now and then many at once
            if (kind < 4) {
                what.call_back = false;
                what.hops.clear();
                what.work_ms = 0;
                auto terms = terms_of("instant", to, what, limit);
                if (waits && same == 0) {
                    auto got = co_await ask(calls_now.instant, to.way, terms, what, limit);
                } else if (later) {
                    fire(calls_later.instant, to.way, terms, what, limit, patience);
                } else {
                    fire(calls_now.instant, to.way, terms, what, limit, patience);
                }
            } else if (kind < 9) {
                auto terms = terms_of("working", to, what, limit);
                if (waits && same == 0) {
                    auto got = co_await ask(calls_later.working, to.way, terms, what, limit);
                } else if (later) {
                    fire(calls_later.working, to.way, terms, what, limit, patience);
                } else {
                    fire(calls_now.working, to.way, terms, what, limit, patience);
                }
            } else {
                auto terms = terms_of("alone", to, what, limit);
                fire(calls_now.alone, to.way, terms, what, limit, patience);
            }
            if (same == 0) break;
        }
    }
}

template <class Services>
void actor::provide_calls(const Services& services) {
    using request = typename std::decay_t<decltype(services.instant)>::request_type;
    using response = typename std::decay_t<decltype(services.instant)>::response_type;
    provide(services.instant, [this](request asked) { return answer_now<request, response>(asked); });
    provide(services.working, [this](request asked, const ise::call_context& context) {
        return handle<request, response>(std::move(asked), context);
    });
    provide_exclusive(services.alone, [this](request asked, const ise::call_context& context) {
        return handle<request, response>(std::move(asked), context);
    });
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

void actor::provide_calls() {
    if (plan_.later_version) {
        provide_calls(calls_later);
    } else {
        provide_calls(calls_now);
    }
}

} // namespace seeds
