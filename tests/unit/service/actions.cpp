// Actions: goals, reports, outcomes; and the failures that users of other systems tell of, as stories of the virtual
// world: a goal that is lost, a result that never arrives, a cancellation that is ignored, a report behind the end of
// its requester, two requesters that are mixed up. Where such a failure was reported of ROS 2, the story names it.
#include <ise/core/error.hpp>
#include <ise/core/sleep.hpp>
#include <ise/packet/dynamic.hpp>
#include <ise/service/action.hpp>
#include <ise/service/action_run.hpp>
#include <ise/service/action_runs.hpp>
#include <ise/service/dynamic.hpp>
#include <ise/service/session.hpp>

#include <support/catch.hpp>
#include <support/sim_parties.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <vector>

namespace actions_test {

using namespace ise_test;
using namespace std::chrono_literals;
using ise::errc;
using ise::execution;
using ise_test::Contains;

struct waypoint {
    std::string name;
    std::uint32_t legs = 3;
};
struct leg_sailed {
    std::string to;
    std::uint32_t leg = 0;
};
struct arrival {
    std::string at;
    std::uint32_t legs = 0;
};
inline constexpr ise::action<waypoint, leg_sailed, arrival> sail_to{"sail_to"};
using voyage = ise::action_run<ise::action<waypoint, leg_sailed, arrival>>;

namespace {

// What became of each goal at the provider.
struct logbook {
    std::map<std::string, int> begun, arrived, cancelled;
    std::map<std::string, ise::time_point> arrived_at;
    int sailing = 0, most = 0;
};

template <class Handler>
void add_action(party& to, Handler handler, ise::action_options options = ise::action_options()) {
    to.services->services().add(ise::make_action(*to.services, sail_to, std::move(handler), options)).value();
}

ise::task<arrival> sail(party& boat, std::shared_ptr<logbook> log, waypoint to, ise::progress<leg_sailed> progress,
                        ise::duration leg_time) {
    struct at_sea {
        logbook& log;
        explicit at_sea(logbook& of) : log(of) { log.most = std::max(log.most, ++log.sailing); }
        ~at_sea() { --log.sailing; }
    };
    at_sea sailing(*log);
    ++log->begun[to.name];
    try {
        for (std::uint32_t leg = 1; leg <= to.legs; ++leg) {
            co_await ise::sleep_for(boat.on, leg_time);
            leg_sailed done{to.name, leg};
            co_await progress(done);
        }
    } catch (const std::exception&) {
        ++log->cancelled[to.name];
        throw;
    }
    if (to.name == "shoals") throw ise::error(errc::refused, "too shallow");
    if (to.name == "storm") throw ise::error(errc::refused, std::string(200'000, '~'));
    if (to.name == "edge") throw std::runtime_error("fell off");
    ++log->arrived[to.name];
    log->arrived_at[to.name] = boat.on.now();
    arrival made{to.name, to.legs};
    co_return made;
}

struct sea {
    std::shared_ptr<logbook> log = std::make_shared<logbook>();
    std::string where, listens;
    ise::duration leg_time; // of runs that begin from now on
    sim_parties all;
    party& boat;
    party& shore;
    ise::remote there;

    auto sailing(party& by) {
        return [this, &by](waypoint to, ise::progress<leg_sailed> progress) {
            return sail(by, log, std::move(to), std::move(progress), leg_time);
        };
    }

    explicit sea(ise::action_options options = ise::action_options(), std::uint64_t seed = 1,
                 const std::string& scheme = "tcp", ise::duration of_a_leg = 1s, ise::service_options of_boat = quick(),
                 ise::service_options of_shore = quick())
        : where(scheme + "://boat:7400"), listens(scheme + "://0.0.0.0:7400"), leg_time(of_a_leg), all(seed),
          boat(all.add("boat", of_boat)), shore(all.add("shore", of_shore)) {
        add_action(boat, sailing(boat), options);
        boat.listen(listens);
        there = shore.at(where);
    }
    static ise::service_options quick() {
        ise::service_options made;
        made.accepts.heartbeat_ns = 300'000'000;
        made.linger = 20s;
        return made;
    }
    static ise::service_options modest() {
        auto made = quick();
        made.accepts.max_message_bytes = 100'000;
        return made;
    }
    void cut() {
        for (auto& [raw, session] : shore.services->sessions())
            session->wire().close(ise::failure(errc::peer_lost, "cut"));
    }
};

// What a requester saw.
struct report_of {
    std::vector<std::uint32_t> legs;
    std::optional<ise::result<arrival>> outcome;
    std::optional<ise::failure> not_started;
    std::uint32_t before = 0;
    bool started = false, mixed_up = false;
    ise::time_point accepted_at{};
};
using shared_report = std::shared_ptr<report_of>;

ise::task<> request(ise::remote boat, waypoint to, ise::run_options options, shared_report into) {
    voyage run;
    try {
        run = co_await boat.start(sail_to, to, options);
    } catch (const ise::error& refused) {
        into->not_started = refused.why();
    }
    if (into->not_started) co_return;
    into->started = true;
    into->before = run.queue_position();
    for (;;) {
        auto leg = co_await run.next();
        if (!leg) break;
        into->mixed_up = into->mixed_up || leg->to != to.name;
        into->legs.push_back(leg->leg);
    }
    auto outcome = co_await run.try_result();
    if (outcome) into->mixed_up = into->mixed_up || outcome->at != to.name;
    into->outcome.emplace(std::move(outcome));
}

struct requested {
    shared_report report = std::make_shared<report_of>();
    std::shared_ptr<started<void>> running;

    bool done() const { return running->done; }
    errc code() const {
        REQUIRE(report->outcome);
        REQUIRE_FALSE(*report->outcome);
        return report->outcome->error().code();
    }
};

requested ask(sea& at, std::string name, std::uint32_t legs = 3, ise::run_options options = ise::run_options()) {
    requested made;
    options.accept = 1min;
    made.running = start(at.shore.on, request(at.there, waypoint{std::move(name), legs}, options, made.report));
    return made;
}

} // namespace

TEST_CASE("a run reports its progress, and ends with its result") {
    sea at;
    auto asked = ask(at, "bay");
    REQUIRE(at.all.run_until([&] { return asked.done(); }));
    CHECK(asked.report->legs == std::vector<std::uint32_t>{1, 2, 3});
    REQUIRE(asked.report->outcome);
    REQUIRE(*asked.report->outcome);
    CHECK((*asked.report->outcome)->at == "bay");
    // Nothing of it is left.
    CHECK(
        at.all.run_until([&] { return at.boat.services->services().find_publication("sail_to")->subscribers() == 0; }));
}

TEST_CASE("what a handler throws is the outcome of its run") {
    sea at;
    auto shallow = ask(at, "shoals"), fell = ask(at, "edge");
    REQUIRE(at.all.run_until([&] { return shallow.done() && fell.done(); }));
    CHECK(shallow.code() == errc::refused);
    CHECK_THAT(shallow.report->outcome->error().message(), Contains("too shallow"));
    CHECK(fell.code() == errc::handler_failed);
    CHECK_THAT(fell.report->outcome->error().message(), Contains("fell off"));
    CHECK(fell.report->outcome->error().executed() == execution::unknown);
    CHECK(fell.report->legs.size() == 3);
}

TEST_CASE("a goal beyond what its provider accepts is refused here, and the session stays") {
    sea at(ise::action_options(), 1, "tcp", 1s, sea::modest());
    auto other = ask(at, "bay", 5);
    REQUIRE(at.all.run_until([&] { return other.report->legs.size() == 1; }));
    const auto began = at.all.world.now();
    auto large = ask(at, std::string(200'000, 'x'));
    REQUIRE(at.all.run_until([&] { return large.done(); }));
    CHECK(at.all.world.now() - began < 100ms);
    REQUIRE(large.report->not_started);
    CHECK(large.report->not_started->code() == errc::too_large);
    CHECK(large.report->not_started->executed() == execution::not_executed);
    CHECK_THAT(large.report->not_started->message(), Contains("accepts 100000 (max_message_bytes)"));
    REQUIRE(at.all.run_until([&] { return other.done(); }));
    CHECK(*other.report->outcome);
    CHECK(at.boat.services->counts().sessions_accepted == 1);
}

TEST_CASE("a result beyond what its requester accepts is an error that says so") {
    const std::string scheme = GENERATE("tcp", "udp");
    INFO(scheme);
    sea at(ise::action_options(), 1, scheme, 1s, sea::quick(), sea::modest());
    auto legs = GENERATE(0u, 3u); // of reports that are too large as well
    auto asked = ask(at, std::string(200'000, 'x'), legs);
    SECTION("over one session") {}
    SECTION("over another one, on which its requester comes back") {
        at.all.world.run_for(2500ms);
        at.all.world.net().partition("boat", "shore");
        at.all.world.run_for(5s);
        at.all.world.net().heal_all();
    }
    REQUIRE(at.all.run_until([&] { return asked.done(); }));
    CHECK(asked.code() == errc::too_large);
    CHECK(asked.report->outcome->error().executed() == execution::unknown);
    CHECK_THAT(asked.report->outcome->error().message(),
               Contains("its requester accepts") && Contains("(max_message_bytes)"));
    auto next = ask(at, "bay");
    REQUIRE(at.all.run_until([&] { return next.done(); }));
    CHECK(*next.report->outcome);
}

TEST_CASE("the outcome of a run whose handler throws a long text has the beginning of that") {
    sea at(ise::action_options(), 1, "tcp", 1s, sea::quick(), sea::modest());
    auto asked = ask(at, "storm");
    REQUIRE(at.all.run_until([&] { return asked.done(); }));
    CHECK(asked.code() == errc::refused);
    CHECK_THAT(asked.report->outcome->error().message(), Contains("~~~"));
    CHECK(asked.report->outcome->error().message().size() < 5'000);
    CHECK(at.boat.services->counts().sessions_accepted == 1);
}

TEST_CASE("goals wait up to a number of bytes") {
    sea at(ise::action_options::queueing());
    auto first = ask(at, "bay", 100);
    REQUIRE(at.all.run_until([&] { return first.report->started; }));
    std::vector<requested> all;
    for (int i = 0; i < 20; ++i) all.push_back(ask(at, std::string(5 << 20, 'x'), 0));
    at.all.world.run_for(10s);
    auto refused = [](const requested& one) { return one.report->not_started.has_value(); };
    REQUIRE(std::ranges::count_if(all, refused) == 8); // 64 MiB hold twelve of them
    const auto& why = *std::ranges::find_if(all, refused)->report->not_started;
    CHECK(why.code() == errc::overloaded);
    CHECK(why.executed() == execution::not_executed);
    CHECK_THAT(why.message(), Contains("waiting_bytes"));
    REQUIRE(at.all.run_until([&] { return std::ranges::all_of(all, &requested::done); }));
    CHECK(std::ranges::count_if(all, [](const auto& one) { return one.report->outcome && *one.report->outcome; }) ==
          12);
}

TEST_CASE("several runs at once, one after the other, in place of the last, or refused") {
    SECTION("at once, up to a number") {
        ise::action_options options;
        options.concurrent = 3;
        sea at(options);
        std::vector<requested> all;
        for (const char* name : {"a", "b", "c", "d"}) all.push_back(ask(at, name));
        REQUIRE(at.all.run_until([&] { return std::ranges::all_of(all, &requested::done); }));
        CHECK(at.log->most == 3);
        REQUIRE(all[3].report->not_started);
        CHECK(all[3].report->not_started->code() == errc::overloaded);
        CHECK(all[3].report->not_started->executed() == execution::not_executed);
        CHECK_FALSE(at.log->begun.contains("d"));
    }
    SECTION("in a queue") {
        auto options = ise::action_options::queueing();
        options.waiting = 2;
        sea at(options);
        std::vector<requested> all;
        for (const char* name : {"a", "b", "c", "d"}) all.push_back(ask(at, name));
        REQUIRE(at.all.run_until([&] { return std::ranges::all_of(all, &requested::done); }));
        CHECK(at.log->most == 1);
        for (std::size_t i = 0; i < 3; ++i) {
            REQUIRE(all[i].report->outcome);
            CHECK(*all[i].report->outcome);
            CHECK(all[i].report->before == i);
        }
        REQUIRE(all[3].report->not_started);
        CHECK_THAT(all[3].report->not_started->message(), Contains("2 goals waiting"));
    }
    SECTION("replaced") {
        sea at(ise::action_options::replacing());
        auto first = ask(at, "a", 100);
        REQUIRE(at.all.run_until([&] { return first.report->legs.size() == 2; }));
        auto second = ask(at, "b"), third = ask(at, "c");
        REQUIRE(at.all.run_until([&] { return first.done() && second.done() && third.done(); }));
        CHECK(first.code() == errc::cancelled);
        CHECK_THAT(first.report->outcome->error().message(), Contains("replaced by a newer goal"));
        CHECK(second.code() == errc::cancelled);
        CHECK(*third.report->outcome);
        CHECK(at.log->most == 1); // never two of them at the rudder
        CHECK(at.log->begun["b"] == 0);
        CHECK(at.log->cancelled["a"] == 1);
    }
    SECTION("refused") {
        sea at(ise::action_options::exclusive());
        auto first = ask(at, "a");
        REQUIRE(at.all.run_until([&] { return first.report->started; }));
        auto second = ask(at, "b");
        REQUIRE(at.all.run_until([&] { return first.done() && second.done(); }));
        CHECK(*first.report->outcome);
        REQUIRE(second.report->not_started);
        CHECK(second.report->not_started->code() == errc::overloaded);
    }
}

namespace {

ise::task<> start_and_drop(ise::remote boat, std::shared_ptr<int> stage) {
    waypoint to{"far", 1000};
    {
        auto run = co_await boat.start(sail_to, to);
        *stage = 1;
        auto leg = co_await run.next();
        *stage = 2;
    }
    *stage = 3;
}

ise::task<errc> start_and_cancel(ise::remote boat) {
    waypoint to{"far", 1000};
    auto run = co_await boat.start(sail_to, to);
    auto leg = co_await run.next();
    run.cancel();
    auto outcome = co_await run.try_result();
    co_return outcome ? errc{} : outcome.error().code();
}

ise::task<> stubborn_wait(party& boat, ise::progress<leg_sailed> progress, std::shared_ptr<int> swallowed) {
    for (;;) {
        try {
            co_await ise::sleep_for(boat.on, 10ms);
            leg_sailed done{"nowhere", 1};
            co_await progress(done);
        } catch (const std::exception&) {
            if (++*swallowed == 5) throw; // it was told again and again
        }
    }
}

} // namespace

TEST_CASE("dropping a run, cancelling it, or the coroutine that waits for it, cancels the handler") {
    sea at;
    auto stage = std::make_shared<int>(0);
    auto dropped = start(at.shore.on, start_and_drop(at.there, stage));
    REQUIRE(at.all.run_until([&] { return dropped->done; }));
    CHECK(*stage == 3);
    REQUIRE(at.all.run_until([&] { return at.log->cancelled["far"] == 1; }));

    CHECK(at.all.run(at.shore, start_and_cancel(at.there)) == errc::cancelled);
    REQUIRE(at.all.run_until([&] { return at.log->cancelled["far"] == 2; }));

    auto waiting = ask(at, "far", 1000);
    REQUIRE(at.all.run_until([&] { return waiting.report->legs.size() == 1; }));
    waiting.running->cancel.emit(asio::cancellation_type::terminal);
    REQUIRE(at.all.run_until([&] { return waiting.done() && at.log->cancelled["far"] == 3; }));
    CHECK(at.log->sailing == 0);
}

TEST_CASE("the deadline of a run ends it at both ends, also while they cannot reach each other") {
    sea at;
    ise::run_options options;
    options.deadline = 3500ms;
    auto late = ask(at, "far", 1000, options);
    REQUIRE(at.all.run_until([&] { return late.done() && at.log->sailing == 0; }));
    CHECK(late.code() == errc::timed_out);
    CHECK(late.report->legs.size() == 3);
    CHECK(at.log->cancelled["far"] == 1);

    auto apart = ask(at, "farther", 1000, options);
    REQUIRE(at.all.run_until([&] { return apart.report->legs.size() == 1; }));
    const auto begun = at.boat.on.now();
    at.all.world.net().partition("boat", "shore");
    REQUIRE(at.all.run_until([&] { return apart.done() && at.log->sailing == 0; }));
    CHECK(at.boat.on.now() - begun < 4s);
    CHECK(apart.code() == errc::timed_out);
    at.all.world.net().heal_all();
}

TEST_CASE("a run that reports nothing for its idle time is given up, and one that reports is not") {
    sea at(ise::action_options(), 1, "tcp", 3s);
    ise::run_options options;
    options.idle = 4s;
    auto lively = ask(at, "bay", 5, options);
    options.idle = 2s;
    auto silent = ask(at, "far", 5, options);
    REQUIRE(at.all.run_until([&] { return lively.done() && silent.done(); }));
    CHECK(*lively.report->outcome);
    CHECK(silent.code() == errc::timed_out);
    CHECK_THAT(silent.report->outcome->error().message(), Contains("reported nothing for 2 s (idle)"));
    CHECK(at.log->cancelled["far"] == 1);
}

TEST_CASE("a goal for nobody, for another service, or for a component that stops has a clear end") {
    sea at;
    CHECK_THROWS_AS(voyage().cancel(), ise::error);
    at.boat.services->services().remove("sail_to");
    auto nobody = ask(at, "bay");
    REQUIRE(at.all.run_until([&] { return nobody.done(); }));
    REQUIRE(nobody.report->not_started);
    CHECK(nobody.report->not_started->code() == errc::no_such_service);
    CHECK(nobody.report->not_started->executed() == execution::not_executed);
}

TEST_CASE("an action that is withdrawn cancels its runs, and their requesters learn of it") {
    sea at;
    auto asked = ask(at, "far", 1000);
    REQUIRE(at.all.run_until([&] { return asked.report->legs.size() == 2; }));
    at.boat.services->services().remove("sail_to");
    REQUIRE(at.all.run_until([&] { return asked.done() && at.log->sailing == 0; }));
    CHECK(asked.code() == errc::no_such_service);
    CHECK(asked.report->outcome->error().executed() == execution::unknown);
}

namespace {

ise::task<> begin_run(ise::remote there, std::optional<voyage>& into) {
    waypoint to{"anywhere", 1};
    into.emplace(co_await there.start(sail_to, to));
}

} // namespace

TEST_CASE("a run whose provider answers a new session with rubbish is over, and so is its subscription") {
    sim_parties all;
    auto& boat = all.add("boat");
    auto& shore = all.add("shore");
    auto provider = std::make_shared<ise::publication_core>(*boat.services, "sail_to", sail_to.types());
    int asked = 0;
    provider->accept = [&](ise::bytes_view, const ise::adapter*,
                           const ise::subscriber_info&) -> ise::result<ise::bytes> {
        if (++asked == 1) return ise::encode(ise::action_accepted());
        return ise::bytes(3, std::byte{7});
    };
    boat.services->services().add(provider).value();
    boat.listen("tcp://0.0.0.0:7400");
    std::optional<voyage> run;
    all.run(shore, begin_run(shore.at("tcp://boat:7400"), run));
    for (auto& [raw, session] : shore.services->sessions()) session->wire().close(ise::failure(errc::peer_lost, "cut"));
    all.world.run_for(5s);
    CHECK(asked == 2);
    CHECK(run->done());
    all.world.run_for(40s); // the first one lingers
    CHECK(provider->subscribers() == 0);
    run.reset();
    provider->publish(ise::trace_id(), ise::bytes_view()); // to nobody
    all.world.run_for(1s);
}

TEST_CASE("an action is known by its packets, and run without its header") {
    CHECK(ise::is_action(sail_to.types()));
    CHECK_FALSE(ise::is_action(ise::subscription<waypoint>::types()));
    auto types = ise::schemas_of_action(sail_to.types());
    CHECK(types.goal.fingerprint() == ise::schema_of<waypoint>().fingerprint());
    CHECK(types.feedback.fingerprint() == ise::schema_of<leg_sailed>().fingerprint());
    CHECK(types.result.fingerprint() == ise::schema_of<arrival>().fingerprint());
    CHECK(ise::encode(ise::action_goal<waypoint>{}).size() ==
          ise::action_layout::goal + ise::encode(waypoint{}).size());

    sea at;
    auto body = [](ise::remote boat, std::shared_ptr<std::string> into) -> ise::task<> {
        auto service = ise::dynamic_contract::of(sail_to);
        auto goal =
            ise::dynamic_packet::from_json(ise::schemas_of_action(*service.types()).goal, R"({"name":"bay","legs":2})");
        auto run = co_await ise::start_dynamic(boat, service, std::move(goal));
        auto& held = run.value();
        for (;;) {
            auto leg = co_await held.next();
            if (!leg) break;
            *into += leg->to_json();
        }
        auto outcome = co_await held.outcome();
        *into += outcome.value().to_json();
    };
    auto found_result = std::make_shared<std::string>();
    at.all.run(at.shore, body(at.there, found_result));
    CHECK(*found_result == R"({"to":"bay","leg":1}{"to":"bay","leg":2}{"at":"bay","legs":2})");
}

// --- the stories ------------------------------------------------------------------------------------------------

namespace {

void cut_somewhere(sea& at, std::mt19937_64& dice) {
    auto which = dice() % 2 ? ise::sim::direction::to_server : ise::sim::direction::to_client;
    at.all.world.net().cut("shore", "boat", which, dice() % 600);
}

void in_foul_weather(sea& at, std::mt19937_64& dice) {
    auto& way = at.all.world.net().between("boat", "shore");
    way.jitter = std::chrono::milliseconds(dice() % 50);
    way.loss = 0.03;
    way.duplicate = 0.03;
    way.reorder = 0.03;
}

const char* scheme_of(std::uint64_t seed) { return seed % 3 == 0 ? "udp" : "tcp"; }

/// Tells a story with each seed from 1 on, on a sea of its own in foul weather.
template <class Story>
void with_seeds(std::uint64_t seeds, ise::duration leg_time, Story tell,
                ise::action_options options = ise::action_options()) {
    for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
        INFO("seed " << seed);
        std::mt19937_64 dice(seed);
        sea at(options, seed, scheme_of(seed), leg_time);
        in_foul_weather(at, dice);
        tell(at, dice);
    }
}

/// Runs a requester's coroutine to its end; the run that it reported of arrived.
template <class Requester>
report_of arrived_of(sea& at, Requester requester) {
    auto seen = std::make_shared<report_of>();
    auto running = start(at.shore.on, requester(seen));
    REQUIRE(at.all.run_until([&] { return running->done; }));
    REQUIRE(seen->outcome);
    CHECK(*seen->outcome);
    return *seen;
}

} // namespace

TEST_CASE("story: a goal is never lost and never executed twice, wherever the connection breaks while it is given") {
    int came_through = 0;
    with_seeds(60, 10ms, [&](sea& at, std::mt19937_64& dice) {
        for (int i = 0; i < 3; ++i) cut_somewhere(at, dice);
        auto asked = ask(at, "bay");
        REQUIRE(at.all.run_until([&] { return asked.done(); }));
        CHECK(at.log->begun["bay"] <= 1);
        // It began, and its outcome came; or it is said that it did not begin.
        if (asked.report->outcome && *asked.report->outcome) {
            CHECK(at.log->arrived["bay"] == 1);
            ++came_through;
        } else {
            REQUIRE(asked.report->not_started);
            if (asked.report->not_started->executed() == execution::not_executed) CHECK(at.log->begun["bay"] == 0);
        }
    });
    CHECK(came_through == 60); // within a minute the connection came back
}

TEST_CASE("story: a result arrives, or it is said within the linger that it does not, whatever becomes of the way") {
    int results = 0, unknown = 0;
    with_seeds(60, 1s, [&](sea& at, std::mt19937_64& dice) {
        at.leg_time = std::chrono::milliseconds(100 + dice() % 900);
        auto asked = ask(at, "bay", 5);
        REQUIRE(at.all.run_until([&] { return asked.report->started; }));
        // Faults of all kinds, now and then, around its end.
        for (int i = 0; i < 4 && !asked.done(); ++i) {
            at.all.world.run_for(std::chrono::milliseconds(dice() % 1500));
            switch (dice() % 3) {
                case 0: at.cut(); break;
                case 1: cut_somewhere(at, dice); break;
                default: {
                    at.all.world.net().partition("boat", "shore");
                    at.all.world.run_for(std::chrono::milliseconds(dice() % (dice() % 5 == 0 ? 40'000 : 8'000)));
                    at.all.world.net().heal_all();
                }
            }
        }
        const auto calm = at.shore.on.now();
        REQUIRE(at.all.run_until([&] { return asked.done(); }));
        CHECK(at.shore.on.now() - calm < 40s);
        REQUIRE(asked.report->outcome);
        CHECK(at.log->begun["bay"] == 1);
        if (*asked.report->outcome) {
            CHECK(at.log->arrived["bay"] == 1);
            ++results;
        } else { // the provider had given it up
            CHECK(asked.code() == errc::peer_lost);
            CHECK(asked.report->outcome->error().executed() == execution::unknown);
            ++unknown;
        }
        CHECK(std::ranges::is_sorted(asked.report->legs));
        REQUIRE(at.all.run_until([&] { return at.log->sailing == 0; })); // and nobody sails on alone
    });
    CHECK(results > 40);
    CHECK(unknown > 0);
}

TEST_CASE("story: a provider that is restarted does not begin the goal again, and its requester is told") {
    with_seeds(20, 200ms, [](sea& at, std::mt19937_64& dice) {
        auto asked = ask(at, "far", 1000);
        REQUIRE(at.all.run_until([&] { return asked.report->started; }));
        at.all.world.run_for(std::chrono::milliseconds(dice() % 2000));
        for (auto& [raw, session] : at.boat.services->sessions())
            session->wire().close(ise::failure(errc::peer_lost, "gone"));
        at.boat.services->stop(100ms);
        at.boat.scope.stop();
        REQUIRE(at.all.run_until([&] { return at.boat.scope.size() == 0; }));
        CHECK(at.log->cancelled["far"] == 1);
        auto& next = at.all.add("boat", sea::quick());
        add_action(next, at.sailing(next));
        bool listens = false;
        while (!listens) {
            try {
                next.listen(at.listens);
                listens = true;
            } catch (const ise::error&) {
                at.all.world.run_for(100ms);
            }
        }
        REQUIRE(at.all.run_until([&] { return asked.done(); }));
        CHECK(at.log->begun["far"] == 1);
        CHECK(asked.code() == errc::peer_lost);
        CHECK(asked.report->outcome->error().executed() == execution::unknown);
        auto again = ask(at, "bay");
        REQUIRE(at.all.run_until([&] { return again.done(); }));
        REQUIRE(again.report->outcome);
        CHECK(*again.report->outcome);
    });
}

TEST_CASE(
    "story: a cancellation is never ignored, when it comes before the answer, in an outage, or to a deaf handler") {
    with_seeds(40, 50ms, [&](sea& at, std::mt19937_64& dice) {
        auto asked = ask(at, "far", 100'000);
        at.all.world.run_for(std::chrono::milliseconds(dice() % 100)); // the goal may be on its way
        if (dice() % 2) at.all.world.net().partition("boat", "shore");
        at.all.world.run_for(std::chrono::milliseconds(dice() % 3000));
        asked.running->cancel.emit(asio::cancellation_type::terminal);
        at.all.world.run_for(std::chrono::milliseconds(dice() % 3000));
        at.all.world.net().heal_all();
        REQUIRE(at.all.run_until([&] { return asked.done(); }));
        at.all.world.run_for(25s); // the linger
        CHECK(at.log->sailing == 0);
        CHECK(at.log->begun["far"] == at.log->cancelled["far"]);
        CHECK(at.log->begun["far"] <= 1);
    });
    sim_parties all;
    auto& boat = all.add("boat");
    auto& shore = all.add("shore");
    auto swallowed = std::make_shared<int>(0);
    add_action(boat, [&, swallowed](waypoint to, ise::progress<leg_sailed> progress) -> ise::task<arrival> {
        co_await stubborn_wait(boat, progress, swallowed);
        arrival made{to.name, 0};
        co_return made;
    });
    boat.listen("tcp://0.0.0.0:7400");
    CHECK(all.run(shore, start_and_cancel(shore.at("tcp://boat:7400"))) == errc::cancelled);
    CHECK(all.run_until([&] { return *swallowed == 5; }));
}

// rclcpp#2265: feedback was delivered behind a cancellation, to objects that were gone.
TEST_CASE("story: nothing is called behind the end of a requester, whenever it goes") {
    with_seeds(40, 5ms, [&](sea& at, std::mt19937_64& dice) {
        std::vector<requested> all;
        for (int i = 0; i < 5; ++i) all.push_back(ask(at, fmt::format("{}", i), 20));
        at.all.world.run_for(std::chrono::milliseconds(dice() % 400));
        if (dice() % 2) at.cut();
        if (dice() % 2) { // the whole component goes, with reports and outcomes on their way
            at.shore.services->stop(std::chrono::milliseconds(dice() % 200));
            at.shore.scope.stop();
        }
        for (auto& one : all) one.running->cancel.emit(asio::cancellation_type::terminal);
        REQUIRE(at.all.run_until([&] { return std::ranges::all_of(all, &requested::done); }));
        auto before = all;
        at.all.world.run_for(30s);
        CHECK(at.log->sailing == 0);
        CHECK(at.boat.services->services().find_publication("sail_to")->subscribers() == 0);
        CHECK(at.boat.escaped.empty());
    });
}

TEST_CASE("story: requesters of one action are never mixed up") {
    with_seeds(20, 20ms, [&](sea& at, std::mt19937_64& dice) {
        auto& other = at.all.add("other", sea::quick());
        std::vector<requested> all;
        for (int i = 0; i < 10; ++i) {
            const auto legs = static_cast<std::uint32_t>(1 + dice() % 20);
            all.push_back(ask(at, fmt::format("shore {}", i), legs));
            requested made;
            waypoint to{fmt::format("other {}", i), legs};
            made.running = start(other.on, request(other.at(at.where), to, ise::run_options(), made.report));
            all.push_back(made);
            at.all.world.run_for(std::chrono::milliseconds(dice() % 60));
            if (dice() % 4 == 0) at.cut();
        }
        REQUIRE(at.all.run_until([&] { return std::ranges::all_of(all, &requested::done); }));
        int results = 0;
        for (const auto& one : all) {
            CHECK_FALSE(one.report->mixed_up);
            CHECK(std::ranges::is_sorted(one.report->legs));
            if (one.report->outcome && *one.report->outcome) ++results;
            else {
                REQUIRE(one.report->not_started); // beyond 16 at once
                CHECK(one.report->not_started->code() == errc::overloaded);
            }
        }
        CHECK(results >= 10);
        CHECK(at.log->most <= 16);
        for (const auto& [name, count] : at.log->begun) CHECK(count == 1);
    });
}

namespace {

// One goal after the other, each begun as soon as the last has ended.
ise::task<> one_after_the_other(ise::remote boat, int goals, std::mt19937_64 dice, std::shared_ptr<int> arrived) {
    for (int i = 0; i < goals; ++i) {
        waypoint to{fmt::format("{}", i), static_cast<std::uint32_t>(dice() % 2)}; // often it arrives at once
        auto run = co_await boat.start(sail_to, to);
        const bool looks = dice() % 2 != 0;
        if (looks) {
            auto leg = co_await run.next();
            if (leg && leg->to != to.name) co_return;
        }
        auto outcome = co_await run.try_result();
        if (outcome && outcome->at == to.name) ++*arrived;
    }
}

// Takes a report now and then.
ise::task<> read_slowly(party& by, ise::remote boat, waypoint to, shared_report into) {
    auto run = co_await boat.start(sail_to, to);
    into->accepted_at = by.on.now();
    for (;;) {
        auto leg = co_await run.next();
        if (!leg) break;
        into->legs.push_back(leg->leg);
        co_await ise::sleep_for(by.on, 100ms);
    }
    auto outcome = co_await run.try_result();
    into->outcome.emplace(std::move(outcome));
}

// Asks for the result after a while, which may be the moment in which it comes.
ise::task<> ask_for_result(party& by, ise::remote boat, waypoint to, ise::duration after, shared_report into) {
    auto run = co_await boat.start(sail_to, to);
    co_await ise::sleep_for(by.on, after);
    auto outcome = co_await run.try_result();
    into->outcome.emplace(std::move(outcome));
}

// Everything that a run has is used where a report is handled: the run itself, its end, another goal.
ise::task<> use_in_report(ise::remote boat, shared_report into) {
    waypoint to{"far", 100'000}, next{"bay", 1};
    auto run = co_await boat.start(sail_to, to);
    auto leg = co_await run.next();
    if (!leg || run.done() || !run.connected() || run.queue_position() != 0) co_return;
    auto other = co_await boat.start(sail_to, next); // meanwhile more reports came
    run.cancel();
    auto behind = co_await run.next();
    if (behind) into->legs.push_back(behind->leg);
    auto ended = co_await run.try_result();
    into->started = !ended && ended.error().code() == errc::cancelled;
    auto outcome = co_await other.try_result();
    into->outcome.emplace(std::move(outcome));
}

} // namespace

// rclcpp#1757: the result of an action that was quick was never delivered. icey#15: goals in a chain blocked each
// other, and what came before the result was asked for was lost.
TEST_CASE("story: an outcome that comes at once is not lost, and the next goal may begin where it is handled") {
    auto story = [](sea& at, std::mt19937_64& dice) {
        auto arrived = std::make_shared<int>(0);
        auto running = start(at.shore.on, one_after_the_other(at.there, 50, dice, arrived));
        REQUIRE(at.all.run_until([&] { return running->done; }));
        CHECK(*arrived == 50);
        CHECK(at.log->most == 1);
        for (const auto& [name, count] : at.log->begun) CHECK(count == 1);
    };
    with_seeds(20, 1ms, story, ise::action_options::exclusive());
}

// rclcpp#2451: feedback that came faster than the client took it kept the acceptance and the result from being seen.
TEST_CASE("story: reports that come faster than they are taken hold up neither the acceptance nor the outcome") {
    with_seeds(20, 1ms, [&](sea& at, std::mt19937_64&) {
        auto seen = arrived_of(at, [&](shared_report into) {
            return read_slowly(at.shore, at.there, waypoint{"bay", 3000}, into);
        });
        CHECK(seen.accepted_at < at.log->arrived_at["bay"]);
        // After the reports that waited, and those of a way with losses.
        CHECK(at.shore.on.now() - at.log->arrived_at["bay"] < 3s);
        CHECK(std::ranges::is_sorted(seen.legs));
        REQUIRE_FALSE(seen.legs.empty());
        CHECK(seen.legs.back() > 2900); // the newest were kept
    });
}

// rclcpp#2130: asking for the result while it was received blocked the client.
TEST_CASE("story: the result may be asked for in the moment in which it comes") {
    with_seeds(100, 20ms, [&](sea& at, std::mt19937_64& dice) {
        const auto after = std::chrono::microseconds(dice() % 120'000);
        arrived_of(at, [&](shared_report into) {
            return ask_for_result(at.shore, at.there, waypoint{"bay", 3}, after, into);
        });
    });
}

// rclcpp#2243: using the goal's handle in the feedback callback blocked the client.
TEST_CASE("story: a run can be used, cancelled and followed by another where its report is handled") {
    with_seeds(20, 1ms, [&](sea& at, std::mt19937_64&) {
        auto seen = arrived_of(at, [&](shared_report into) { return use_in_report(at.there, into); });
        CHECK(seen.started); // as cancelled
        CHECK(seen.legs.empty());
        REQUIRE(at.all.run_until([&] { return at.log->sailing == 0; }));
        CHECK(at.log->cancelled["far"] == 1);
    });
}

} // namespace actions_test
