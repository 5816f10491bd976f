// A loop that looks for events instead of sleeping: when it does, and when it gives up.
#include "inproc_threads.hpp"

#include <ise/core/real/linux/poller.hpp>

#include <support/catch.hpp>

namespace polling_test {

namespace {

using namespace std::chrono_literals;
using ise::real::poll_policy;

// Looks until it is told to sleep; how often.
int looks_in_vain(poll_policy& policy, ise::time_point& at) {
    for (int looks = 1;; ++looks, at += 1us)
        if (!policy.on_nothing(at)) return looks;
}

void find(poll_policy& policy, ise::time_point& at) {
    REQUIRE(policy.on_nothing(at));
    at += 1us;
    REQUIRE(policy.on_nothing(at));
    at += 1us;
    REQUIRE(policy.on_event());
}

struct set_clock final : threads::bare_environment {
    ise::time_point at{};
    ise::time_point now() const override { return at; }
};

struct fixture {
    set_clock clock;
    std::shared_ptr<ise::real::poll_seats> seats = std::make_shared<ise::real::poll_seats>();
    asio::io_context io{1};
    ise::loop loop{clock, io.get_executor(), [] { return true; }};
    ise::real::poller poller{clock, io.get_executor(), 50us, seats};
    fixture() { loop.use_watcher(&poller); }
    ~fixture() { loop.use_watcher(nullptr); }

    void turn() { ise::loop::turn in(loop); }
    // Whether a look was queued. The next one is a microsecond later.
    bool look() {
        io.restart();
        bool was_queued = io.poll_one() == 1;
        clock.at += 1us;
        return was_queued;
    }
    int looks() {
        for (int count = 0;; ++count)
            if (!look()) return count;
    }
};

} // namespace

TEST_CASE("polling: what comes within the window is found by looking") {
    poll_policy policy(50us);
    ise::time_point at{};
    CHECK_FALSE(policy.looking());
    REQUIRE(policy.on_event());
    for (int n = 0; n < 10'000; ++n) find(policy, at);
    CHECK(looks_in_vain(policy, at) == 51);
    CHECK_FALSE(policy.looking());
    CHECK(policy.on_event()); // once in vain is no reason to give up
}

TEST_CASE("polling: after several windows in vain it rests, longer each time, and tries again") {
    poll_policy policy(50us);
    ise::time_point at{};
    for (unsigned n = 0; n < poll_policy::patience; ++n) {
        REQUIRE(policy.on_event());
        looks_in_vain(policy, at);
    }
    for (unsigned rest = poll_policy::first_rest; rest <= 4 * poll_policy::max_rest; rest *= 2) {
        for (unsigned n = 0; n < std::min(rest, poll_policy::max_rest); ++n) REQUIRE_FALSE(policy.on_event());
        REQUIRE(policy.on_event()); // one try
        looks_in_vain(policy, at);
    }
    for (unsigned n = 0; n < poll_policy::max_rest; ++n) REQUIRE_FALSE(policy.on_event());
    REQUIRE(policy.on_event());
    find(policy, at); // it pays again
    for (unsigned n = 0; n < poll_policy::patience; ++n) {
        looks_in_vain(policy, at);
        REQUIRE(policy.on_event() == (n + 1 < poll_policy::patience));
    }
    for (unsigned n = 1; n < poll_policy::first_rest; ++n) REQUIRE_FALSE(policy.on_event());
    CHECK(policy.on_event());
}

TEST_CASE("polling: it gives up where another thread needs the core") {
    poll_policy policy(1s);
    ise::time_point at{};
    REQUIRE(policy.on_event());
    SECTION("also if something is found afterwards") {
        for (unsigned n = 0; n < poll_policy::patience; ++n) {
            REQUIRE(policy.on_nothing(at));
            CHECK_FALSE(policy.suspicious(at + 1us));
            at += 20us;
            CHECK(policy.suspicious(at));
            policy.on_preempted();
            REQUIRE(policy.on_event() == (n + 1 < poll_policy::patience));
        }
    }
    SECTION("and sleeps at once if nothing is found") {
        for (unsigned n = 0; n < poll_policy::patience; ++n) {
            REQUIRE(policy.on_nothing(at));
            policy.on_preempted();
            CHECK_FALSE(policy.on_nothing(at));
            REQUIRE(policy.on_event() == (n + 1 < poll_policy::patience));
        }
    }
    CHECK_FALSE(policy.looking());
}

TEST_CASE("polling: what was due anyhow does not count as found") {
    poll_policy policy(50us);
    ise::time_point at{};
    for (unsigned n = 0; n < poll_policy::patience; ++n) {
        REQUIRE(policy.on_event());
        REQUIRE(policy.on_event()); // a turn that was posted
        REQUIRE(policy.on_nothing(at));
        REQUIRE(policy.on_event()); // another one
        looks_in_vain(policy, at);
    }
    CHECK_FALSE(policy.on_event());
}

TEST_CASE("polling: a loop looks from a turn to the next, and sleeps after the window") {
    fixture it;
    CHECK(it.looks() == 0); // nothing was there to do
    it.turn();
    CHECK(it.looks() == 51);
    it.turn();
    for (int n = 0; n < 1000; ++n) {
        REQUIRE(it.look());
        if (n % 40 == 39) it.turn();
    }
    CHECK(it.looks() == 51);
    CHECK(it.looks() == 0);
}

TEST_CASE("polling: no more loops than cores look at the same time") {
    fixture it;
    while (it.seats->take()) {} // the others
    it.turn();
    CHECK(it.looks() == 0);
    it.seats->give_back();
    for (unsigned n = 0; n < poll_policy::first_rest; ++n) it.turn();
    CHECK(it.looks() == 0);
    it.turn();
    CHECK(it.looks() == 51);
    CHECK(it.seats->take()); // the seat is free again
    it.poller.stop();
    it.turn();
    CHECK(it.looks() == 0);
}

} // namespace polling_test
