#include <ise/net/heartbeats.hpp>

#include <support/catch.hpp>

#include <chrono>

namespace liveness_test {
using namespace std::chrono_literals;
using ise::net::liveness;

const ise::time_point start{1h};

TEST_CASE("a new connection is pinged at once, and again only when nothing was sent for the peer's period") {
    liveness alive(1s, start);
    CHECK(alive.look(start, 2s).ping);
    alive.answered(1ms);
    alive.heard(start + 500ms);
    CHECK_FALSE(alive.look(start + 500ms, 2s).ping);
    alive.heard(start + 2s);
    CHECK(alive.look(start + 2s, 2s).ping);
    CHECK(alive.last_sent() == start + 2s);
}

TEST_CASE("until the first ping is answered, each look sends another one") {
    liveness alive(1s, start);
    CHECK(alive.look(start, 1s).ping);
    CHECK(alive.look(start + 100ms, 1s).ping);
    alive.answered(1ms);
    CHECK_FALSE(alive.look(start + 200ms, 1s).ping);
    CHECK(alive.round_trip() == 1ms);
}

TEST_CASE("one that sends other things all the time is pinged every fourth period all the same") {
    liveness alive(1s, start);
    alive.look(start, 1s);
    alive.answered(1ms);
    int pings = 0;
    for (auto now = start + 500ms; now <= start + 8s; now += 500ms) {
        alive.heard(now);
        alive.sent(now);
        pings += alive.look(now, 1s).ping;
    }
    CHECK(pings == 2);
}

TEST_CASE("a peer is lost after three of its periods without a sign, and not before") {
    liveness alive(1s, start);
    auto next = alive.look(start, 1s).look_again;
    for (int count = 0; count < 100; ++count) {
        auto found = alive.look(next, 1s);
        if (found.lost) break;
        next = found.look_again;
    }
    CHECK(next == start + 3s);
    CHECK(alive.last_heard() == start);
}

TEST_CASE("who did not come round itself gives the peer one period more, as what it sent may be unread") {
    liveness alive(1s, start);
    alive.look(start, 1s);
    auto late = alive.look(start + 1min, 1s);
    CHECK_FALSE(late.lost);
    CHECK(late.look_again <= start + 1min + 1s);
    auto found = late;
    for (auto now = late.look_again; !found.lost && now < start + 2min; now = found.look_again) {
        found = alive.look(now, 1s);
        if (found.lost) CHECK(now == start + 1min + 1s);
    }
    CHECK(found.lost);
}

} // namespace liveness_test
