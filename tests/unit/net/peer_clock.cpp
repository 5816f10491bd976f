#include <ise/net/heartbeats.hpp>

#include <support/catch.hpp>

namespace peer_clock_test {

using namespace std::chrono_literals;
using ise::time_point;

namespace {

time_point deadline_by(const ise::net::peer_clock& clock, time_point ours, time_point now) {
    return ise::saturating_add(ours, clock.ahead(now));
}

} // namespace

TEST_CASE("a peer's clock is known to half of the shortest round trip, and less well as time goes by") {
    ise::net::peer_clock clock;
    CHECK_FALSE(clock.known());
    const auto ahead = GENERATE(0s, 5000s, -5000s);
    auto note = [&](time_point sent, ise::duration there, ise::duration back) {
        clock.note(sent, sent + there + ahead, sent + there + back);
    };
    const time_point begin(10000s);
    note(begin, 300ms, 100ms);
    REQUIRE(clock.known());
    CHECK(clock.uncertainty(begin + 400ms) == 200ms);
    auto true_deadline = [&](time_point ours) { return ours + ahead; };
    CHECK(deadline_by(clock, begin + 10s, begin + 400ms) <= true_deadline(begin + 10s));
    CHECK(deadline_by(clock, begin + 10s, begin + 400ms) >= true_deadline(begin + 10s) - 400ms);
    note(begin + 1s, 1ms, 1ms);
    CHECK(clock.uncertainty(begin + 1s) <= 2ms);
    note(begin + 2s, 900ms, 900ms); // one that was held up takes nothing away
    CHECK(clock.uncertainty(begin + 4s) <= 4ms);
    CHECK(clock.uncertainty(begin + 1000s) >= 400ms); // drift
    CHECK(deadline_by(clock, begin + 1010s, begin + 1000s) <= true_deadline(begin + 1010s));
    note(begin + 1000s, 1ms, 1ms);
    CHECK(clock.uncertainty(begin + 1000s) <= 2ms);
    CHECK(deadline_by(clock, time_point::max(), begin + 1000s) >= time_point::max() - 6000s);
}

TEST_CASE("a deadline is never later on the peer's clock, however uneven the round trip was and however close it is") {
    const time_point begin(10000s);
    const auto there = GENERATE(0ms, 10ms, 7000ms), back = GENERATE(0ms, 10ms, 7000ms),
               remaining = GENERATE(0ms, 1ms, 1000ms, 20000ms);
    ise::net::peer_clock clock;
    clock.note(begin, begin + there, begin + there + back); // the two clocks are one
    const auto now = begin + there + back;
    CHECK(deadline_by(clock, now + remaining, now) <= now + remaining);
    CHECK(deadline_by(clock, now + remaining, now) >= now + remaining - (there + back));
}

TEST_CASE("a peer's clock that jumps counts as it is now, and one that makes no sense not at all") {
    ise::net::peer_clock clock;
    const time_point begin(10000s);
    clock.note(begin, begin + 1ms, begin + 2ms);
    clock.note(begin + 1s, begin + 1s + 60s, begin + 1s + 2ms); // this side was suspended for a minute
    CHECK(deadline_by(clock, begin + 20s, begin + 2s) > begin + 79s);
    CHECK(deadline_by(clock, begin + 20s, begin + 2s) <= begin + 80s);
    clock.note(begin + 3s, time_point::max(), begin + 3s);
    clock.note(begin + 3s, time_point::min(), begin + 3s);
    clock.note(begin + 4s, begin + 4s, begin + 3s);
    CHECK(deadline_by(clock, begin + 20s, begin + 3s) > begin + 79s);
    ise::net::peer_clock same;
    same.is_ours();
    CHECK(deadline_by(same, begin, begin - 1ns) == begin);
}

} // namespace peer_clock_test
