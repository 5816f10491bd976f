#include <ise/net/heartbeats.hpp>

#include <support/catch.hpp>

#include <asio/buffer.hpp>

#include <chrono>
#include <memory>
#include <span>
#include <string>
#include <system_error>

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

TEST_CASE("the shortest heartbeat that is wanted is that of a peer that is there") {
    struct quiet final : ise::stream {
        ise::task<ise::transfer> read_some(asio::mutable_buffer) override { co_return ise::transfer{}; }
        ise::transfer try_write(std::span<const asio::const_buffer>) override { return {}; }
        ise::task<std::error_code> wait_writable() override { co_return std::error_code(); }
        void shutdown_write() override {}
        void close() override {}
        std::string peer() const override { return {}; }
    } line;
    ise::net::heartbeat_senders all;
    int told = 0;
    all.on_shorter([&] { ++told; });
    CHECK(all.min_heartbeat() == ise::duration::max());
    auto usual = std::make_shared<ise::net::heartbeat_sender>(line, 1s, start);
    auto hasty = std::make_shared<ise::net::heartbeat_sender>(line, 20ms, start);
    all.add(usual);
    all.add(hasty);
    CHECK(told == 2);
    all.show(start);
    CHECK(all.min_heartbeat() == 20ms);
    hasty.reset();
    all.show(start);
    CHECK(all.min_heartbeat() == 1s);
    usual.reset();
    all.show(start);
    CHECK(all.min_heartbeat() == ise::duration::max());
    CHECK(told == 2);
}

} // namespace liveness_test
