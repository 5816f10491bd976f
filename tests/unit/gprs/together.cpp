// Boat and shore together, over ways that break in every manner.
#include "strait.hpp"

#include <support/catch.hpp>

namespace together_test {

using namespace std::chrono_literals;
using gprs_test::strait;

namespace {

/// Five packets, then the link is used again for five more; all of it arrives.
void tell_a_story(strait& it) {
    it.put_fixes(1, 2);
    it.run_for(500ms);
    it.put_fixes(3, 3);
    it.run_until([&] { return it.all_acknowledged() && it.cuts > 0; }, 5min);
    it.put_fixes(6, 5);
    it.run_until([&] { return it.all_acknowledged(); });
}

} // namespace

TEST_CASE(
    "gprs link: whichever byte on the way up is the last of a connection, nothing is lost and nothing comes twice") {
    for (std::size_t n = 0;; ++n) {
        strait it(false, n);
        it.cut_up = n;
        it.change_address(); // the next connection is the one
        tell_a_story(it);
        INFO("cut after " << n << " bytes");
        REQUIRE(it.all_acknowledged());
        REQUIRE(it.once_each(1, 10));
        REQUIRE(it.never_back());
        REQUIRE(it.remarks.empty());
        if (it.cuts == 0) {
            CHECK(n > 500);
            break;
        }
    }
}

TEST_CASE("gprs link: the same on the way down") {
    for (std::size_t n = 0;; ++n) {
        strait it(false, n);
        it.cut_down = n;
        it.change_address();
        tell_a_story(it);
        INFO("cut after " << n << " bytes");
        REQUIRE(it.all_acknowledged());
        REQUIRE(it.once_each(1, 10));
        REQUIRE(it.never_back());
        if (it.cuts == 0) {
            CHECK(n > 80);
            break;
        }
    }
}

TEST_CASE("gprs link: a carrier that delays by seconds loses nothing") {
    for (bool datagrams : {false, true})
        for (auto delay : {2s, 9s, 25s}) {
            strait it(datagrams);
            it.delay = delay;
            it.jitter = 3s;
            for (std::uint32_t n = 1; n <= 40; ++n) {
                it.put_fixes(n, 1);
                it.run_for(5s);
            }
            it.run_until([&] { return it.all_acknowledged(); });
            INFO((datagrams ? "datagrams" : "connection") << ", delay " << delay.count() << " s");
            CHECK(it.all_acknowledged());
            CHECK(it.once_each(1, 40));
            CHECK(it.never_back());
        }
}

TEST_CASE("gprs link: a half open link is noticed, and what was said into it comes by the next") {
    for (bool datagrams : {false, true}) {
        strait it(datagrams);
        it.put_fixes(1, 3);
        it.run_until([&] { return it.all_acknowledged(); });
        it.up = false;
        for (std::uint32_t n = 4; n <= 30; ++n) {
            it.put_fixes(n, 1);
            it.run_for(10s);
        }
        CHECK(it.boat->counters().half_open >= 2);
        CHECK(it.arrived.size() == 3);
        it.up = true;
        it.run_until([&] { return it.all_acknowledged(); });
        CHECK(it.all_acknowledged());
        CHECK(it.once_each(1, 30));
        CHECK(it.never_back());
        CHECK(it.arrived[3].sequence == 30); // the newest first
        CHECK_FALSE(it.arrived[3].history);
        CHECK(it.arrived.back().history);
    }
}

TEST_CASE("gprs link: a changed address costs a period, and nothing else") {
    strait it(true);
    for (std::uint32_t n = 1; n <= 60; ++n) {
        it.put_fixes(n, 1);
        it.run_for(5s);
        if (n % 7 == 0) it.change_address();
    }
    it.run_until([&] { return it.all_acknowledged(); });
    CHECK(it.all_acknowledged());
    CHECK(it.once_each(1, 60));
    CHECK(it.never_back());
    CHECK(it.shore.counters().moves >= 8);
    CHECK(it.shore.counters().half_open == 0);
}

TEST_CASE("gprs link: datagrams that are lost, late and out of order are all there in the end, once") {
    for (std::uint64_t seed = 1; seed <= 30; ++seed) {
        strait it(true, seed);
        it.loss = 0.3;
        it.jitter = 4s;
        for (std::uint32_t n = 1; n <= 50; ++n) {
            it.put_fixes(n, 1);
            it.run_for(std::chrono::milliseconds(it.random() % 6000));
            if (it.random() % 20 == 0) it.change_address();
        }
        it.run_until([&] { return it.all_acknowledged(); });
        INFO("seed " << seed << (it.remarks.empty() ? "" : ": " + it.remarks.front()));
        REQUIRE(it.all_acknowledged());
        REQUIRE(it.once_each(1, 50));
        REQUIRE(it.never_back());
        REQUIRE(it.shore.counters().given_up == 0);
    }
}

TEST_CASE("gprs link: connections that break at any time, and outages, lose nothing") {
    for (std::uint64_t seed = 1; seed <= 30; ++seed) {
        strait it(false, seed);
        it.delay = 700ms;
        it.jitter = 900ms;
        for (std::uint32_t n = 1; n <= 60; ++n) {
            it.put_fixes(n, 1);
            it.run_for(std::chrono::milliseconds(it.random() % 5000));
            auto dice = it.random() % 30;
            if (dice == 0) it.change_address();
            if (dice == 1) it.up = !it.up;
        }
        it.up = true;
        it.run_until([&] { return it.all_acknowledged(); });
        INFO("seed " << seed);
        REQUIRE(it.all_acknowledged());
        REQUIRE(it.once_each(1, 60));
        REQUIRE(it.never_back());
    }
}

TEST_CASE("gprs link: a shore that was restarted goes on with what was not acknowledged") {
    for (bool datagrams : {false, true}) {
        strait it(datagrams);
        it.put_fixes(1, 10);
        it.run_until([&] { return it.all_acknowledged(); });
        it.restart_shore();
        it.put_fixes(11, 10);
        it.run_until([&] { return it.all_acknowledged(); });
        CHECK(it.all_acknowledged());
        CHECK(it.once_each(1, 20));
        CHECK(it.shore.counters().given_up == 0);
    }
}

TEST_CASE("gprs link: nothing is acknowledged before it is safe, and all of it once it is") {
    for (bool datagrams : {false, true}) {
        strait it(datagrams);
        it.safe_at_once = false;
        it.put_fixes(1, 10);
        it.run_for(30s);
        CHECK(it.boat->waiting() == 10);
        it.change_address();
        it.run_for(60s);
        CHECK(it.boat->waiting() == 10);
        it.keep_all();
        it.run_until([&] { return it.all_acknowledged(); });
        CHECK(it.all_acknowledged());
        CHECK(it.once_each(1, 10));
    }
}

TEST_CASE("gprs link: a boat that starts again is a new one, whatever of the old one is under way") {
    strait it(false);
    it.delay = 2s;
    it.put_fixes(1, 5);
    it.run_for(1s);
    it.restart_boat(6);
    it.put(gprs_test::fix(0, 6));
    it.put(gprs_test::fix(1, 6));
    it.run_until([&] { return it.all_acknowledged(); });
    CHECK(it.all_acknowledged());
    CHECK(it.boat->acknowledged() == 2);
    CHECK(it.shore.boot() == 6);
    REQUIRE(it.arrived.size() >= 2);
    CHECK_FALSE(it.arrived.back().history);
}

TEST_CASE("gprs link: a long history arrives in full, while news is not held up by it") {
    strait it(false);
    it.up = false;
    it.run_for(20s);
    for (std::uint32_t n = 1; n <= 5000; ++n) it.boat->put(gprs_test::fix(n));
    it.up = true;
    it.delay = 600ms;
    it.run_until([&] { return it.arrived.size() > 100; });
    it.put_fixes(5001, 1);
    auto before = it.arrived.size();
    it.run_until([&] {
        return std::any_of(it.arrived.begin(), it.arrived.end(), [](const auto& one) { return one.sequence == 5001; });
    });
    CHECK(it.arrived.size() - before < 100);
    it.run_until([&] { return it.all_acknowledged(); });
    CHECK(it.once_each(1, 5001));
    CHECK(it.never_back());
}

} // namespace together_test
