// SIGKILL of either side in the main phases of a session, with real processes and sockets; every byte of a session is
// swept in the virtual world.
#include "host.hpp"

using namespace host_test;
using ise_test::program;

TEST_CASE("host: a provider killed during the handshake costs the caller an attempt") {
    console shore;
    program dead(vessel_at("tcp://127.0.0.1:0"));
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
    console shore;
    program vessel(vessel_at("tcp://127.0.0.1:0"));
    auto at = vessel.read_line();
    auto running = shore.call(at, 3'600'000, 3600s);
    REQUIRE(shore.answer(shore.call(at, 1, 60s))); // behind the other: that one has arrived
    vessel.signal(SIGKILL);
    auto got = shore.answer(running);
    REQUIRE_FALSE(got);
    CHECK(got.error().code() == ise::errc::peer_lost);
    CHECK(got.error().executed() == ise::execution::unknown);
    vessel.wait();
    auto waits = shore.call(at, 0, 60s);
    program next(vessel_at(at));
    CHECK(shore.answer(waits));
}

TEST_CASE("host: a subscription goes on with the provider's next life, and says that it does not know the gap") {
    console shore;
    auto vessel = std::make_unique<program>(vessel_at("tcp://127.0.0.1:0"));
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
    ise_test::real_parties all;
    auto& boat = all.add("boat");
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
    auto at = boat.listen("tcp://127.0.0.1:0").text();
    auto phase = GENERATE(as<std::string>(), "call", "subscription", "both");
    INFO(phase);
    std::vector<std::unique_ptr<program>> clients;
    if (phase != "subscription") clients.push_back(std::make_unique<program>(std::vector<std::string>{"host_vessel", "call", at}));
    if (phase != "call") clients.push_back(std::make_unique<program>(std::vector<std::string>{"host_vessel", "follow", at}));
    all.run_until([&] { return napping + static_cast<int>(out.subscribers()) == static_cast<int>(clients.size()); });
    for (auto& client : clients) client->signal(SIGKILL);
    all.run_until([&] { return napping == 0 && boat.services->sessions().empty(); });
    CHECK(boat.services->calls().open_calls() == 0);
    CHECK(boat.escaped.empty());
}
