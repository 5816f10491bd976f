// One session with everything in it, disturbed at every place where it can be disturbed: nothing hangs, nothing leaks
// (under ASan), and afterwards calls go through again.
#include <support/boat_services.hpp>
#include <support/catch.hpp>
#include <support/sim_parties.hpp>

namespace sweeps_test {

using namespace boat_services;
using namespace ise_test;
using namespace std::chrono_literals;

namespace {

struct voyage {
    sim_parties all;
    party& boat = all.add("boat");
    party& shore = all.add("shore");
    ise::publication<ise::subscription<fix>> fixes = boat.publish(position);
    ise::remote there = shore.at("tcp://boat:7400");
    int handlers = 0;
    int repeated = 0;

    voyage() {
        boat.provide(helm, [this](set_mode asked) -> ise::task<mode_set> {
            ++handlers;
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
        boat.listen("tcp://0.0.0.0:7400");
        auto ticking = [](ise::loop& on, ise::publication<ise::subscription<fix>> out) -> ise::task<> {
            for (int i = 0;; ++i) {
                co_await ise::sleep_for(on, 100ms);
                fix here{1.0 * i, 0, 0};
                out(here);
            }
        };
        boat.scope.spawn("ticker", ticking(boat.on, fixes));
    }

    // Calls, a subscription, a message in pieces.
    static ise::task<> sail(ise::remote boat) {
        set_mode hold{"hold"};
        auto first = co_await boat.try_call(helm, hold, 2s);
        auto stream = co_await boat.subscribe(position, ise::subscribe_options::keep_last(2));
        for (int i = 0; i < 4; ++i) {
            auto packet = co_await stream.next();
            if (!packet) break;
        }
        blob big;
        big.content.resize(200'000);
        auto echoed = co_await boat.try_call(echo, big, 2s);
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

} // namespace

TEST_CASE("sweep: cancelled at every event of a session") {
    std::size_t events = 0;
    for (std::size_t at = 0;; ++at) {
        INFO("cancelled at event " << at);
        voyage run;
        auto sailing = start(run.shore.on, voyage::sail(run.there));
        std::size_t seen = 0;
        bool reached = false;
        run.all.world.run_until([&] {
            if (seen++ == at) {
                reached = true;
                sailing->cancel.emit(asio::cancellation_type::terminal);
            }
            return sailing->done;
        });
        CHECK(sailing->done);
        run.check_alive();
        CHECK(run.all.stop());
        CHECK(run.fixes.subscribers() == 0);
        if (!reached) break;
        events = at;
    }
    CHECK(events > 30);
}

TEST_CASE("sweep: stopped at every event of a session") {
    for (std::size_t at = 0;; at += 2) {
        INFO("stopped at event " << at);
        voyage run;
        bool provider = at % 4 == 0;
        auto sailing = start(run.shore.on, voyage::sail(run.there));
        std::size_t seen = 0;
        bool reached = false;
        run.all.world.run_until([&] {
            if (seen++ != at) return sailing->done;
            reached = true;
            return true;
        });
        auto& who = provider ? run.boat : run.shore;
        who.services->stop(1s);
        who.scope.stop();
        sailing->cancel.emit(asio::cancellation_type::terminal);
        CHECK(run.all.world.run_until([&] { return sailing->done && who.scope.size() == 0; }));
        CHECK(who.services->calls().open_calls() == 0);
        CHECK(run.all.stop());
        if (!reached) break;
    }
}

TEST_CASE("sweep: the n-th operation fails") {
    std::uint64_t failures = 0;
    for (std::uint64_t at = 0;; ++at) {
        INFO("operation " << at);
        voyage run;
        run.all.world.fail_at(at);
        auto sailing = start(run.shore.on, voyage::sail(run.there));
        CHECK(run.all.world.run_until([&] { return sailing->done; }));
        bool failed = run.all.world.faults().failed();
        run.all.world.faults().fail_never();
        bool listens = !run.boat.services->listening().empty();
        if (listens) run.check_alive();
        CHECK(run.all.stop());
        if (!failed) break;
        ++failures;
    }
    CHECK(failures > 20);
}

TEST_CASE("sweep: the connection is cut at every byte of a session") {
    auto which = GENERATE(ise::sim::direction::to_server, ise::sim::direction::to_client);
    // Every byte of the handshake and the small frames; then in steps through the big message.
    for (std::uint64_t at = 0;; at += at < 1500 ? 1 : 4999) {
        INFO("cut after byte " << at);
        voyage run;
        run.all.world.net().cut("shore", "boat", which, at);
        auto sailing = start(run.shore.on, voyage::sail(run.there));
        CHECK(run.all.world.run_until([&] { return sailing->done; }));
        auto cuts = run.all.world.net().cuts();
        run.check_alive();
        CHECK(run.all.stop());
        if (cuts == 0) break;
    }
}

} // namespace sweeps_test
