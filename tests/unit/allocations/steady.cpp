// What happens over and over allocates nothing. On real sockets, as the virtual network allocates its events.
#include "counting.hpp"

#include <ise/asio.hpp>
#include <support/boat_services.hpp>
#include <support/catch.hpp>
#include <support/real_parties.hpp>

#include <asio/post.hpp>

namespace steady_test {

using namespace boat_services;
using namespace ise_test;
using namespace std::chrono_literals;

namespace {

struct heading {
    double degrees = 0;
};
constexpr ise::request_response<heading, heading> turn("turn");
constexpr ise::request_response<blob, heading> stitch("stitch");
constexpr ise::request_response<heading, blob> look("look");

constexpr int rounds = 1000;
// A timer that comes due, a heartbeat: what is not once a round.
constexpr int now_and_then = rounds / 20;

struct fixture {
    real_parties all;
    party& boat = all.add("boat");
    party& shore = all.add("shore");
    ise::remote there;

    void meet(const std::string& over = "tcp://127.0.0.1:0") { there = shore.at(boat.listen(over)); }

    // One round after the other, each begun when the one before has ended; what the first ones set up does not count.
    template <class Round>
    std::uint64_t count(
        Round round, std::uint64_t counted() = +[] { return allocations() + reallocations(); }) {
        for (int i = 0; i < rounds; ++i) round();
        const auto before = counted();
        REQUIRE(before > 0); // they are counted
        for (int i = 0; i < rounds; ++i) round();
        return counted() - before;
    }
};

// Calls again and again, by callbacks.
struct caller {
    ise::remote there;
    int answered = 0;
    bool enough = false;
    void call() {
        there.try_call(turn, heading{1}, 5s, [this](ise::result<heading> answer) {
            answer.value();
            ++answered;
            if (!enough) call();
        });
    }
};

} // namespace

TEST_CASE("a call and its reply allocate nothing where neither side is a coroutine") {
    fixture f;
    f.boat.provide(turn, [](heading wanted) -> heading { return wanted; });
    const std::string over = GENERATE("tcp://127.0.0.1:0", "udp://127.0.0.1:0");
    f.meet(over);
    caller calling{f.there};
    asio::post(f.shore.on.get_executor(), [&] { calling.call(); });
    int wanted = 0;
    auto counted = f.count([&] {
        ++wanted;
        f.all.run_until([&] { return calling.answered >= wanted; });
    });
    calling.enough = true;
    f.all.run_until([&] { return calling.answered > wanted; });
    CAPTURE(over, counted);
    CHECK(counted <= now_and_then);
}

TEST_CASE("a call that is awaited and handled by coroutines allocates nothing once there were as many frames") {
    fixture f;
    f.boat.provide(turn, [](heading wanted) -> ise::task<heading> { co_return wanted; });
    f.meet();
    int answered = 0, wanted = 0;
    auto calling = [&]() -> ise::task<> {
        for (;;) {
            auto answer = co_await f.there.call(turn, heading{1}, 5s);
            static_cast<void>(answer);
            ++answered;
        }
    };
    auto running = start(f.shore.on, calling());
    auto counted = f.count([&] {
        ++wanted;
        f.all.run_until([&] { return answered >= wanted; });
    });
    running->cancel.emit(asio::cancellation_type::terminal);
    f.all.run_until([&] { return running->done; });
    CAPTURE(counted);
    CHECK(counted <= now_and_then); // Asio keeps the frames that were free again
}

TEST_CASE("packets are published and taken without an allocation") {
    fixture f;
    auto fixes = f.boat.publish(position);
    f.meet();
    auto taken = f.all.run(f.shore, f.there.subscribe(position, ise::subscribe_options::keep_last(64)));
    auto counted = f.count([&] {
        for (int i = 0; i < 8; ++i) fixes(fix{1, 2, 3});
        for (int got = 0; got < 8;) {
            f.all.run_until([&] { return taken.try_next() && ++got > 0; });
        }
    });
    CAPTURE(counted);
    CHECK(counted <= now_and_then);
}

TEST_CASE("packets of varying size are decoded into the memory of those before them") {
    fixture f;
    auto shots = f.boat.publish(pictures);
    f.meet();
    auto taken = f.all.run(f.shore, f.there.subscribe(pictures, ise::subscribe_options::keep_last(64)));
    blob shot;
    std::size_t size = 0;
    auto counted = f.count([&] {
        size = (size + 37) % 900;
        shot.content.assign(size, 1);
        shots(shot);
        f.all.run_until([&] { return static_cast<bool>(taken.try_next()); });
    });
    CAPTURE(counted);
    CHECK(counted <= now_and_then);
}

TEST_CASE("a burst that nobody may drop allocates nothing, a packet at a time or many in a stretch") {
    fixture f;
    auto shots = f.boat.publish(pictures);
    f.meet();
    const std::size_t size = GENERATE(std::size_t{40}, std::size_t{1000}, std::size_t{3000});
    constexpr int burst = 60;
    auto taken = f.all.run(f.shore, f.there.subscribe(pictures, ise::subscribe_options::lossless(128)));
    blob shot;
    shot.content.assign(size, 1);
    auto counted = f.count([&] {
        for (int i = 0; i < burst; ++i) shots(shot);
        for (int got = 0; got < burst;) {
            f.all.run_until([&] { return taken.try_next() && ++got > 0; });
        }
    });
    CAPTURE(size, counted);
    CHECK(counted <= 10 * now_and_then); // of 60 packets a round
}

TEST_CASE("messages that go in pieces use the memory of those before them") {
    fixture f;
    const std::size_t size = GENERATE(std::size_t{200'000}, std::size_t{1'000'000});
    f.boat.provide(stitch, [](blob shot) -> heading { return {static_cast<double>(shot.content.size())}; });
    f.boat.provide(look, [size](heading) -> blob { return {std::vector<std::uint8_t>(size, 1)}; });
    auto shots = f.boat.publish(pictures);
    f.meet();
    auto taken = f.all.run(f.shore, f.there.subscribe(pictures, ise::subscribe_options::keep_last(4)));
    blob shot;
    shot.content.assign(size, 1);
    // The vectors are the user's.
    auto counted = f.count(
        [&] {
            f.all.run(f.shore, f.there.call(stitch, shot, 5s));
            f.all.run(f.shore, f.there.call(look, heading{1}, 5s));
            shots(shot);
            f.all.run_until([&] { return static_cast<bool>(taken.try_next()); });
        },
        large_reallocations);
    CAPTURE(size, counted);
    CHECK(counted <= now_and_then);
}

} // namespace steady_test
