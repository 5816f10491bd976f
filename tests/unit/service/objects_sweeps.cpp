// One session within a process with everything in it, disturbed at every event: nothing hangs, nothing leaks (under
// ASan), and afterwards calls go through again. On one loop, and on a loop each.
#include <support/boat_services.hpp>
#include <support/catch.hpp>
#include <support/in_one_process.hpp>

namespace objects_sweeps_test {

using namespace boat_services;
using namespace ise_test;
using namespace std::chrono_literals;

namespace {

struct voyage {
    in_one_process all;
    party& boat = all.add("boat");
    party& shore = all.add("shore");
    ise::publication<ise::subscription<blob>> shots = boat.publish(pictures);
    ise::remote there = shore.at("inproc://boat");

    explicit voyage(bool one_loop) : all(one_loop) {
        boat.provide(helm, [this](set_mode asked) -> ise::task<mode_set> {
            co_await ise::sleep_for(boat.on, 10ms);
            ise::remote back(boat.services->link_back(boat.services->sessions().begin()->second));
            set_mode echoed{asked.mode};
            auto confirmed = co_await back.call(ise::request_response<set_mode, mode_set>("confirm"), echoed, 1s);
            co_return confirmed;
        });
        boat.provide(echo, [](blob given) { return given; });
        shore.provide(ise::request_response<set_mode, mode_set>("confirm"), [](set_mode asked) {
            return mode_set{true, asked.mode};
        });
        boat.listen("inproc://boat");
        auto ticking = [](ise::loop& on, ise::publication<ise::subscription<blob>> out) -> ise::task<> {
            for (std::size_t i = 0;; ++i) {
                co_await ise::sleep_for(on, 100ms);
                blob shot;
                shot.content.resize(i * 20'000);
                co_await out.send(std::move(shot));
            }
        };
        boat.scope.spawn("ticker", ticking(boat.on, shots));
    }

    // Calls, subscriptions, more than lies between the two at once.
    static ise::task<> sail(ise::remote boat) {
        set_mode hold{"hold"};
        auto first = co_await boat.try_call(helm, hold, 2s);
        auto some = co_await boat.subscribe(pictures, ise::subscribe_options::keep_last(2));
        auto all = co_await boat.subscribe(pictures, ise::subscribe_options::lossless(2));
        for (int i = 0; i < 4; ++i) {
            auto packet = co_await some.next();
            if (!packet) break;
            auto other = co_await all.next();
            if (!other) break;
        }
        blob big;
        big.content.resize(400'000);
        auto echoed = co_await boat.try_call(echo, big, 2s);
        auto again = co_await boat.try_call(echo, std::move(big), 2s);
    }
    static ise::task<ise::result<mode_set>> probe(ise::remote boat) {
        set_mode request{"probe"};
        auto got = co_await boat.try_call(helm, request, 60s);
        co_return got;
    }

    void check_alive() {
        auto got = all.run(shore, probe(there));
        INFO((got ? std::string() : got.error().message()));
        REQUIRE(got);
        CHECK(got->reason == "probe");
        CHECK(shore.services->calls().open_calls() == 0);
        CHECK(boat.services->calls().open_calls() == 0);
    }
};

// Sails until the event, then calls `disturb`; whether there was such an event.
template <class Disturb>
bool disturbed(voyage& run, started<void>& sailing, std::size_t at, Disturb disturb) {
    std::size_t seen = 0;
    bool reached = false;
    run.all.world.run_until([&] {
        if (sailing.done) return true;
        return reached = seen++ == at;
    });
    if (reached) disturb();
    return reached;
}

} // namespace

TEST_CASE("objects, sweep: cancelled at every event of a session") {
    const bool one_loop = GENERATE(false, true);
    std::size_t events = 0;
    for (bool reached = true; reached; ++events) {
        INFO("cancelled at event " << events);
        voyage run(one_loop);
        auto sailing = start(run.shore.on, voyage::sail(run.there));
        reached = disturbed(run, *sailing, events, [&] { sailing->cancel.emit(asio::cancellation_type::terminal); });
        CHECK(run.all.world.run_until([&] { return sailing->done; }));
        run.check_alive();
        CHECK(run.all.stop());
        CHECK(run.shots.subscribers() == 0);
    }
    CHECK(events > 10);
}

TEST_CASE("objects, sweep: stopped at every event of a session") {
    const bool one_loop = GENERATE(false, true);
    const bool provider = GENERATE(false, true);
    std::size_t events = 0;
    for (bool reached = true; reached; ++events) {
        INFO("stopped at event " << events);
        voyage run(one_loop);
        auto sailing = start(run.shore.on, voyage::sail(run.there));
        auto& who = provider ? run.boat : run.shore;
        reached = disturbed(run, *sailing, events, [&] {
            who.services->stop(1s);
            who.scope.stop();
            sailing->cancel.emit(asio::cancellation_type::terminal);
        });
        CHECK(run.all.world.run_until([&] { return sailing->done && (!reached || who.scope.size() == 0); }));
        CHECK(who.services->calls().open_calls() == 0);
        CHECK(run.all.stop());
    }
    CHECK(events > 10);
}

TEST_CASE("objects, sweep: the session is cut at every event") {
    const bool one_loop = GENERATE(false, true);
    const bool provider = GENERATE(false, true);
    std::size_t events = 0;
    for (bool reached = true; reached; ++events) {
        INFO("cut at event " << events);
        voyage run(one_loop);
        auto sailing = start(run.shore.on, voyage::sail(run.there));
        auto& who = provider ? run.boat : run.shore;
        reached = disturbed(run, *sailing, events, [&] {
            for (auto& [raw, held] : std::map(who.services->sessions()))
                held->wire().close(ise::failure(ise::errc::peer_lost, "cut"));
        });
        CHECK(run.all.world.run_until([&] { return sailing->done; }));
        run.check_alive();
        CHECK(run.all.stop());
    }
    CHECK(events > 10);
}

} // namespace objects_sweeps_test
