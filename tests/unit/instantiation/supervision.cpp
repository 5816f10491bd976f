// What is decided about an instance, event by event, on a clock that the test owns.
#include <ise/instantiation/supervision.hpp>
#include <ise/sim/world.hpp>

#include <support/catch.hpp>

namespace supervision_test {

using namespace ise::instantiation;
using namespace std::chrono_literals;
using act = supervision::act;
using state = instance_state;

namespace {

struct watched {
    explicit watched(restart_policy policy = restart_policy::on_failure) : watched(terms_with(policy)) {}
    explicit watched(const restart_terms& terms) : watch(world.host("shore").start_process("server"), terms) {}

    static restart_terms terms_with(restart_policy policy) {
        restart_terms made;
        made.policy = policy;
        made.limit = 3;
        return made;
    }
    void start() {
        REQUIRE(watch.start(now) == act::launch);
        watch.launched(now);
        watch.ready();
        REQUIRE(watch.state() == state::ready);
    }
    /// On to when it wants to be called, and what it wants then.
    act next() {
        REQUIRE(watch.next() != ise::time_point::max());
        now = watch.next();
        return watch.tick(now);
    }
    void begin_again() {
        REQUIRE(next() == act::launch);
        watch.launched(now);
        watch.ready();
    }

    ise::sim::world world;
    ise::time_point now = world.now();
    supervision watch;
};

} // namespace

TEST_CASE("it is launched, becomes ready, and is stopped") {
    watched one;
    one.start();
    CHECK(one.watch.next() == ise::time_point::max());
    CHECK(one.watch.stop(one.now, 5s) == act::terminate);
    CHECK(one.watch.state() == state::stopping);
    CHECK(one.watch.next() == one.now + 5s);
    CHECK(one.watch.ended(one.now + 1s, true, "exit code 0") == act::nothing);
    CHECK(one.watch.state() == state::stopped);
    CHECK(one.watch.over());
    CHECK(one.watch.next() == ise::time_point::max());
}

TEST_CASE("what does not end when asked is killed after the grace") {
    watched one;
    one.start();
    one.watch.stop(one.now, 5s);
    CHECK(one.watch.tick(one.now + 4s) == act::nothing);
    CHECK(one.next() == act::kill);
    CHECK(one.watch.state() == state::stopping);
    one.watch.ended(one.now, false, "signal 9");
    CHECK(one.watch.state() == state::stopped);
    CHECK(one.watch.reason() == "signal 9");
}

TEST_CASE("a second stop may only shorten the grace") {
    watched one;
    one.start();
    one.watch.stop(one.now, 5s);
    one.watch.stop(one.now, 60s);
    CHECK(one.watch.next() == one.now + 5s);
    one.watch.stop(one.now, 1s);
    CHECK(one.watch.next() == one.now + 1s);
    CHECK(one.watch.kill(one.now) == act::kill);
}

TEST_CASE("what ends before it was ever ready has failed, whatever the policy") {
    for (auto policy : {restart_policy::never, restart_policy::on_failure, restart_policy::always}) {
        watched one(policy);
        one.watch.start(one.now);
        one.watch.launched(one.now);
        CHECK(one.watch.ended(one.now, false, "exit code 2") == act::nothing);
        CHECK(one.watch.state() == state::failed);
        CHECK(one.watch.reason() == "it ended before it was ready: exit code 2");
    }
    watched one(restart_policy::always);
    one.watch.start(one.now);
    CHECK(one.watch.not_launched(one.now, "no such file") == act::nothing);
    CHECK(one.watch.state() == state::failed);
}

TEST_CASE("what is not ready in time is killed and has failed") {
    watched one(restart_policy::always);
    one.watch.start(one.now);
    one.watch.launched(one.now);
    CHECK(one.next() == act::kill);
    CHECK(one.watch.late());
    one.watch.ready(); // too late
    one.watch.ended(one.now, false, "signal 9");
    CHECK(one.watch.state() == state::failed);
    CHECK(one.watch.reason() == "it was not ready within 10 s");
}

TEST_CASE("what cannot be launched for long has failed") {
    watched one(restart_policy::always);
    one.watch.start(one.now);
    CHECK(one.next() == act::nothing);
    CHECK(one.watch.state() == state::failed);
}

TEST_CASE("the policy decides whether it is started again") {
    struct expected {
        restart_policy policy;
        bool well;
        state becomes;
    };
    auto all = {expected{restart_policy::never, true, state::stopped},
                expected{restart_policy::never, false, state::failed},
                expected{restart_policy::on_failure, true, state::stopped},
                expected{restart_policy::on_failure, false, state::waiting},
                expected{restart_policy::always, true, state::waiting},
                expected{restart_policy::always, false, state::waiting}};
    for (const auto& each : all) {
        watched one(each.policy);
        one.start();
        CHECK(one.watch.ended(one.now, each.well, "it ended") == act::nothing);
        CHECK(one.watch.state() == each.becomes);
        CHECK(one.watch.reason() == "it ended");
    }
}

TEST_CASE("the pauses before restarts grow up to a limit, with jitter") {
    auto terms = watched::terms_with(restart_policy::on_failure);
    terms.limit = 20;
    terms.max_pause = 4s;
    terms.window = 1h;
    watched one(terms);
    one.start();
    std::vector<ise::duration> pauses;
    for (int life = 0; life < 8; ++life) {
        one.watch.ended(one.now, false, "it ended");
        pauses.push_back(one.watch.next() - one.now);
        one.begin_again();
    }
    ise::duration base = 500ms;
    bool jitter = false;
    for (auto pause : pauses) {
        CHECK(pause >= base / 2);
        CHECK(pause <= base);
        jitter = jitter || (pause != base && pause != base / 2);
        base = std::min(2 * base, ise::duration(4s));
    }
    CHECK(jitter);
    CHECK(one.watch.restarts() == 8);
}

TEST_CASE("too many restarts within the window are a failure that says so") {
    watched one;
    one.start();
    for (int life = 0; life < 3; ++life) {
        one.watch.ended(one.now, false, "exit code 7");
        REQUIRE(one.watch.state() == state::waiting);
        one.begin_again();
    }
    one.watch.ended(one.now, false, "exit code 7");
    CHECK(one.watch.state() == state::failed);
    CHECK(one.watch.reason() == "exit code 7; it was started again 3 times within 60 s, which is the limit");
    CHECK(one.watch.next() == ise::time_point::max());
    CHECK(one.watch.start(one.now) == act::launch); // by hand it may
}

TEST_CASE("restarts that lie behind the window do not count, and the pause is short again") {
    watched one;
    one.start();
    for (int life = 0; life < 20; ++life) {
        one.watch.ended(one.now, false, "it ended");
        REQUIRE(one.watch.state() == state::waiting);
        CHECK(one.watch.next() - one.now <= 500ms);
        one.begin_again();
        one.now += 61s;
    }
}

TEST_CASE("a stop ends the wait for a restart") {
    watched one;
    one.start();
    one.watch.ended(one.now, false, "it ended");
    CHECK(one.watch.stop(one.now, 5s) == act::nothing);
    CHECK(one.watch.state() == state::stopped);
    CHECK(one.watch.tick(one.now + 1h) == act::nothing);
}

TEST_CASE("a restart stops and starts, and one that fails then has failed") {
    watched one(restart_policy::always);
    one.start();
    CHECK(one.watch.restart(one.now) == act::terminate);
    CHECK(one.watch.ended(one.now, true, "exit code 0") == act::launch);
    CHECK(one.watch.state() == state::starting);
    one.watch.launched(one.now);
    one.watch.ended(one.now, false, "exit code 1");
    CHECK(one.watch.state() == state::failed);
    CHECK(one.watch.restart(one.now) == act::launch);
}

TEST_CASE("what does not do its work is ended and started again, by its policy") {
    watched one;
    one.start();
    CHECK(one.watch.unhealthy(one.now, "its probe failed") == act::terminate);
    CHECK(one.watch.state() == state::stopping);
    CHECK(one.next() == act::kill); // it does not hear SIGTERM either
    CHECK(one.watch.ended(one.now, false, "signal 9") == act::nothing);
    CHECK(one.watch.state() == state::waiting);
    CHECK(one.watch.reason() == "its probe failed");
    one.begin_again();
    CHECK(one.watch.restarts() == 1);

    one.watch.unhealthy(one.now, "its probe failed");
    one.watch.stop(one.now, 1s); // the last word
    one.watch.ended(one.now, true, "exit code 0");
    CHECK(one.watch.state() == state::stopped);

    watched never(restart_policy::never);
    never.start();
    CHECK(never.watch.unhealthy(never.now, "its probe failed") == act::nothing);
    CHECK(never.watch.state() == state::ready);
}

TEST_CASE("a stop after a restart was asked for is the last word") {
    watched one;
    one.start();
    one.watch.restart(one.now);
    one.watch.stop(one.now, 1s);
    CHECK(one.watch.ended(one.now, true, "exit code 0") == act::nothing);
    CHECK(one.watch.state() == state::stopped);
}

TEST_CASE("only stops and kills count as stops, not those of a restart or of its policy") {
    watched one;
    one.start();
    one.watch.restart(one.now);
    one.watch.ended(one.now, true, "exit code 0");
    one.watch.launched(one.now);
    one.watch.ready();
    one.watch.unhealthy(one.now, "its probe failed");
    CHECK(one.watch.stops() == 0);
    one.watch.stop(one.now, 1s);
    CHECK(one.watch.stops() == 1);
    one.watch.kill(one.now);
    CHECK(one.watch.stops() == 2);
}

TEST_CASE("a launch that fails when it is not waited for any more changes nothing") {
    watched one(restart_policy::always);
    one.start();
    one.watch.ended(one.now, false, "it ended");
    CHECK(one.next() == act::launch);
    CHECK(one.next() == act::nothing); // it was not launched in time
    CHECK(one.watch.state() == state::waiting);
    auto next = one.watch.next();
    CHECK(one.watch.not_launched(one.now, "late") == act::nothing); // counts once
    CHECK(one.watch.next() == next);
    one.watch.stop(one.now, 1s);
    CHECK(one.watch.not_launched(one.now, "late") == act::nothing);
    CHECK(one.watch.state() == state::stopped);
}

TEST_CASE("a stop before there is a process waits for whoever starts it") {
    watched one;
    one.watch.start(one.now);
    CHECK(one.watch.stop(one.now, 5s) == act::nothing);
    CHECK(one.watch.state() == state::stopping);
    CHECK(one.watch.not_launched(one.now, "stopped") == act::nothing);
    CHECK(one.watch.state() == state::stopped);
}

TEST_CASE("what was adopted is watched over by its policy") {
    watched one;
    one.watch.adopt(one.now, true, 2);
    CHECK(one.watch.state() == state::ready);
    one.watch.ended(one.now, false, "it ended");
    CHECK(one.watch.state() == state::waiting);
    one.begin_again();
    CHECK(one.watch.restarts() == 3);

    watched gone;
    CHECK(gone.watch.adopt_ended(gone.now, 0, false, "nobody knows how") == act::nothing);
    CHECK(gone.watch.state() == state::waiting);
    watched well;
    well.watch.adopt_ended(well.now, 0, true, "exit code 0");
    CHECK(well.watch.state() == state::stopped); // on failure only
    watched never(restart_policy::never);
    never.watch.adopt_ended(never.now, 0, false, "nobody knows how");
    CHECK(never.watch.state() == state::failed);
    watched over;
    over.watch.adopt_over(state::stopped, "as asked", 1);
    CHECK(over.watch.over());
}

} // namespace supervision_test
