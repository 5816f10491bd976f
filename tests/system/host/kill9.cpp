// SIGKILL of either side in the main phases of a session, with real processes and sockets; every byte of a session is
// swept in the virtual world.
#include "host.hpp"

using namespace host_test;
using ise_test::program;

TEST_CASE("host: a provider killed during the handshake costs the caller an attempt") {
    auto scheme = GENERATE(as<std::string>(), "tcp", "udp");
    INFO(scheme);
    console shore;
    program dead(vessel_at(loopback(scheme)));
    auto at = dead.read_line();
    dead.signal(SIGSTOP); // the kernel still takes connections for it
    auto waiting = shore.call(at, 0, 60s);
    shore.until([&] { return bytes_wait_at(at); }); // our hello
    dead.signal(SIGKILL);
    CHECK(dead.wait().exit_code == 128 + SIGKILL);
    program next(vessel_at(at));
    REQUIRE(next.read_line() == at);
    CHECK(shore.answer(waiting)); // not a byte of the request was written before
}

TEST_CASE("host: a provider killed under a call is lost, and whether it ran is unknown") {
    auto scheme = GENERATE(as<std::string>(), "tcp", "udp");
    INFO(scheme);
    console shore;
    program vessel(vessel_at(loopback(scheme)));
    auto at = vessel.read_line();
    auto running = shore.call(at, 3'600'000, 3600s);
    REQUIRE(shore.answer(shore.call(at, 1, 60s))); // behind the other: that one has arrived
    vessel.signal(SIGKILL);
    vessel.wait();
    // Over udp a call outlives its session: only the next life tells that this one has gone.
    std::optional<program> next;
    auto begin_next = [&] {
        next.emplace(vessel_at(at));
        return next->read_line();
    };
    if (scheme == "udp") REQUIRE(begin_next() == at);
    auto got = shore.answer(running);
    REQUIRE_FALSE(got);
    CHECK(got.error().code() == ise::errc::peer_lost);
    CHECK(got.error().executed() == ise::execution::unknown);
    auto waits = shore.call(at, 0, 60s);
    if (!next) REQUIRE(begin_next() == at);
    CHECK(shore.answer(waits));
}

TEST_CASE("host: a subscription goes on with the provider's next life, and says that it does not know the gap") {
    auto scheme = GENERATE(as<std::string>(), "tcp", "udp");
    INFO(scheme);
    console shore;
    auto vessel = std::make_unique<program>(vessel_at(loopback(scheme)));
    auto at = vessel->read_line();
    shore.follow(at);
    for (int life = 0; life < 3; ++life) {
        auto before = shore.heard;
        shore.until([&] { return shore.heard > before + 5; });
        CHECK(shore.restarts == life);
        vessel->signal(SIGKILL);
        vessel->wait();
        vessel = std::make_unique<program>(vessel_at(at));
        REQUIRE(vessel->read_line() == at);
    }
    auto before = shore.heard;
    shore.until([&] { return shore.heard > before + 5; });
    CHECK(shore.restarts == 3);
}

TEST_CASE("host: a caller and a subscriber that are killed leave nothing at the provider") {
    auto scheme = GENERATE(as<std::string>(), "tcp", "udp");
    INFO(scheme);
    ise_test::real_parties all;
    ise::service_options options;
    options.linger = 1s; // a call over udp goes on for so long
    auto& boat = all.add("boat", options);
    int napping = 0;
    boat.provide(nap, [&](rest asked) -> ise::task<rest> {
        struct counted {
            int& count;
            explicit counted(int& of) : count(of) { ++count; }
            ~counted() { --count; }
        } guard(napping);
        co_await ise::sleep_for(boat.on, std::chrono::milliseconds(asked.milliseconds));
        co_return asked;
    });
    auto out = boat.publish(ticks);
    auto at = boat.listen(loopback(scheme)).text();
    auto phase = GENERATE(as<std::string>(), "call", "subscription", "both");
    INFO(phase);
    std::vector<std::unique_ptr<program>> clients;
    if (phase != "subscription")
        clients.push_back(std::make_unique<program>(std::vector<std::string>{"host_vessel", "call", at}));
    if (phase != "call")
        clients.push_back(std::make_unique<program>(std::vector<std::string>{"host_vessel", "follow", at}));
    all.run_until([&] { return napping + static_cast<int>(out.subscribers()) == static_cast<int>(clients.size()); });
    for (auto& client : clients) client->signal(SIGKILL);
    all.run_until([&] { return napping == 0 && boat.services->sessions().empty(); });
    CHECK(boat.services->calls().open_calls() == 0);
    CHECK(boat.escaped.empty());
}
