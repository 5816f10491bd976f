#include "talk.hpp"

#include <asio/bind_cancellation_slot.hpp>
#include <asio/buffer.hpp>
#include <asio/error.hpp>

#include <support/catch.hpp>

namespace streams_test {

using namespace talk;

namespace {

task<> ask(ise::environment& env, ise::loop& on, ise::endpoint to, std::string text, std::string& answer,
           std::string& problem) {
    auto made = co_await env.connect(on, to);
    if (!made) {
        problem = made.error().message();
        co_return;
    }
    auto& link = **made;
    auto failed = co_await write_all(link, text);
    std::array<char, 4096> room;
    while (!failed && answer.size() < text.size()) {
        auto got = co_await link.read_some(asio::buffer(room));
        failed = got.problem;
        answer.append(room.data(), got.bytes);
    }
    if (failed) problem = failed.message();
}

struct pair_of_hosts {
    ise::sim::world world{7};
    ise::sim::process& shore = world.host("shore").start_process("proxy");
    ise::sim::process& boat = world.host("boat").start_process("boat");
    std::unique_ptr<ise::loop_host> shore_loop = shore.make_loop("main");
    std::unique_ptr<ise::loop_host> boat_loop = boat.make_loop("main");
    std::string answer, problem;

    void serve(std::string where = "tcp://0.0.0.0:7400") {
        spawn(shore_loop->loop(), echo_server(shore, shore_loop->loop(), at(where)));
    }
    void call(std::string text, std::string to = "tcp://shore:7400") {
        spawn(boat_loop->loop(), ask(boat, boat_loop->loop(), at(to), std::move(text), answer, problem));
    }
    bool over() const { return !problem.empty() || !answer.empty(); }
};

} // namespace

TEST_CASE("sim: bytes go to another host and back in the link's time") {
    pair_of_hosts two;
    two.world.net().between("boat", "shore").latency = 100ms;
    two.serve();
    two.call("hello");
    REQUIRE(two.world.run_until([&] { return two.over(); }));
    CHECK(two.answer == "hello");
    CHECK(two.problem == "");
    CHECK(two.world.elapsed() == 400ms); // connecting, and there and back
}

TEST_CASE("sim: connecting is refused at once where nobody listens") {
    pair_of_hosts two;
    two.call("hello", "tcp://10.0.0.2:7400");
    REQUIRE(two.world.run_until([&] { return two.over(); }, 1s));
    CHECK(two.problem.find("refused") != std::string::npos);
}

TEST_CASE("sim: connecting times out through a partition and goes on after it") {
    pair_of_hosts two;
    two.serve();
    two.world.net().partition("boat", "shore");
    two.call("hello");
    REQUIRE(two.world.run_until([&] { return two.over(); }));
    CHECK(two.problem.find(make_error_code(asio::error::timed_out).message()) != std::string::npos);
    CHECK(two.world.elapsed() == two.world.net().connect_timeout);
    two.problem.clear();
    two.call("hello");
    two.world.after(3s, [&] { two.world.net().heal("boat", "shore"); });
    REQUIRE(two.world.run_until([&] { return two.over(); }));
    CHECK(two.answer == "hello");
}

TEST_CASE("sim: a world that goes while coroutines wait leaves nothing behind") {
    auto two = std::make_unique<pair_of_hosts>();
    two->serve();
    two->call(std::string(300'000, 'x'));
    SECTION("before anything ran") {}
    SECTION("while connecting") { two->world.run_for(600us); }
    SECTION("in the middle of the talk") { two->world.run_for(5ms); }
    SECTION("in a partition") {
        two->world.run_for(2ms);
        two->world.net().partition("boat", "shore");
        two->world.run_for(10s);
    }
    two.reset();
}

namespace {

task<> give_up_connecting(ise::environment& env, ise::loop& on, ise::endpoint to, std::string& outcome) {
    auto made = co_await env.connect(on, to);
    outcome = made ? "connected" : std::string(ise::name_of(made.error().code()));
}

task<> accept_one(ise::environment& env, ise::loop& on, ise::endpoint where, std::string& outcome) {
    auto channel = env.listen(on, where);
    auto [problem, client] = co_await (*channel)->accept();
    std::string got;
    auto ended = co_await read_all(*client, got);
    outcome = ended == asio::error::connection_reset ? "reset" : ended == asio::error::eof ? "end" : "other";
}

} // namespace

TEST_CASE("sim: giving up a connect at any time leaves nothing open") {
    for (int step = 0; step < 20; ++step) {
        pair_of_hosts two;
        std::string outcome, server;
        asio::cancellation_signal stop;
        spawn(two.shore_loop->loop(), accept_one(two.shore, two.shore_loop->loop(), at("tcp://shore:7400"), server));
        ise::async_run(two.boat_loop->loop().get_executor(),
                       give_up_connecting(two.boat, two.boat_loop->loop(), at("tcp://shore:7400"), outcome),
                       asio::bind_cancellation_slot(stop.slot(), asio::detached));
        int steps = 0;
        two.world.run_until([&] { return steps++ == step; });
        stop.emit(asio::cancellation_type::terminal);
        two.world.run_for(1min);
        CHECK((outcome == "cancelled" || outcome == "connected" || outcome == ""));
        if (outcome == "connected") CHECK(server == "end");
        else CHECK((server == "" || server == "reset" || server == "end"));
        if (step > 0 && server == "") CHECK(outcome != "connected");
    }
}

} // namespace streams_test
