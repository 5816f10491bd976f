#include "talk.hpp"

#include <support/catch.hpp>

namespace crash_test {

using namespace talk;

namespace {

struct witness { // lives in a frame; must go while what it refers to stands
    bool& gone;
    const std::string& owner;
    std::string& seen;
    ~witness() {
        gone = true;
        seen = owner;
    }
};

// What a program makes: coroutines on its loop that refer to it.
struct program {
    ise::sim::process& env;
    std::unique_ptr<ise::loop_host> main;
    std::string name = "a name that is too long to be held inline";

    explicit program(ise::sim::process& on) : env(on), main(on.make_loop("main")) {}
};

task<> wait_with(program& self, bool& gone, std::string& seen) {
    witness frame{gone, self.name, seen};
    co_await sleep(self.main->loop(), 1h);
}

task<> crash_from_inside(program& self, bool& went_on) {
    co_await sleep(self.main->loop(), 1s);
    self.env.crash();
    went_on = true; // this handler goes on to its end
    co_await sleep(self.main->loop(), 1s);
    went_on = false;
}

task<> hold(ise::environment& env, ise::loop& on, ise::endpoint to, std::error_code& ended, bool& connected) {
    auto made = co_await env.connect(on, to);
    if (!made) {
        ended = asio::error::host_unreachable;
        co_return;
    }
    connected = true;
    std::string ignored;
    ended = co_await read_all(**made, ignored);
}

task<> say_now_and_then(ise::environment& env, ise::loop& on, ise::endpoint to, std::error_code& ended) {
    auto made = co_await env.connect(on, to);
    if (!made) co_return;
    while (!ended) {
        ended = co_await write_all(**made, "still there?");
        co_await sleep(on, 1s);
    }
}

ise::sim::host::program server(std::string where, std::vector<ise::sim::process*>* started = nullptr) {
    return [where, started](ise::sim::process& self) -> std::shared_ptr<void> {
        auto made = std::make_shared<program>(self);
        spawn(made->main->loop(), echo_server(self, made->main->loop(), at(where)));
        if (started) started->push_back(&self);
        return made;
    };
}

} // namespace

TEST_CASE("sim: a crash unwinds what waits before the program's own things go") {
    ise::sim::world world;
    bool gone = false;
    std::string seen;
    auto& proxy = world.host("shore").start_process("proxy", [&](ise::sim::process& self) -> std::shared_ptr<void> {
        auto made = std::make_shared<program>(self);
        spawn(made->main->loop(), wait_with(*made, gone, seen));
        return made;
    });
    world.run_for(1s);
    REQUIRE_FALSE(gone);
    SECTION("from outside") { proxy.crash(); }
    SECTION("by script") {
        world.at(2s, [&] { proxy.crash(); });
        world.run_for(2s);
    }
    SECTION("with its host") { proxy.host().crash(); }
    SECTION("stopped") { proxy.stop(); }
    SECTION("restarted") { CHECK(&proxy.restart() != &proxy); }
    CHECK(gone);
    CHECK(seen == "a name that is too long to be held inline");
    CHECK_FALSE(proxy.running());
    CHECK(proxy.read_file("x", 10).error().code() == ise::errc::io_failed);
}

TEST_CASE("sim: a process that crashes inside its own handler stops at the end of it") {
    ise::sim::world world;
    bool went_on = false;
    auto& proxy = world.host("shore").start_process("proxy", [&](ise::sim::process& self) -> std::shared_ptr<void> {
        auto made = std::make_shared<program>(self);
        spawn(made->main->loop(), crash_from_inside(*made, went_on));
        return made;
    });
    CHECK(world.run_until_idle());
    CHECK(went_on);
    CHECK_FALSE(proxy.running());
}

TEST_CASE("sim: the peer of what ended sees what a kernel would show it") {
    ise::sim::world world;
    auto& shore = world.host("shore");
    auto& server_process = shore.start_process("proxy", server("tcp://0.0.0.0:7400"));
    auto& boat = world.host("boat").start_process("boat");
    auto loop = boat.make_loop("main");
    std::error_code ended;
    bool connected = false;
    spawn(loop->loop(), hold(boat, loop->loop(), at("tcp://shore:7400"), ended, connected));
    REQUIRE(world.run_until([&] { return connected; }));
    world.run_for(1s);
    SECTION("a reset when the process crashed") {
        server_process.crash();
        REQUIRE(world.run_until([&] { return bool(ended); }, 1min));
        CHECK(ended == asio::error::connection_reset);
    }
    SECTION("an end when it stopped") {
        server_process.stop();
        REQUIRE(world.run_until([&] { return bool(ended); }, 1min));
        CHECK(ended == asio::error::eof);
    }
    SECTION("nothing when the host is gone") {
        shore.crash();
        CHECK_FALSE(world.run_until([&] { return bool(ended); }, 10h));
    }
    SECTION("nothing when the process is frozen, and it goes on later") {
        server_process.pause();
        CHECK_FALSE(world.run_until([&] { return bool(ended); }, 1h));
        server_process.go_on();
        server_process.stop();
        CHECK(world.run_until([&] { return bool(ended); }, 1min));
    }
    SECTION("a reset during a partition comes after it") {
        world.net().isolate("shore");
        server_process.crash();
        CHECK_FALSE(world.run_until([&] { return bool(ended); }, 1h));
        world.net().heal_all();
        REQUIRE(world.run_until([&] { return bool(ended); }, 1min));
        CHECK(ended == asio::error::connection_reset);
    }
}

TEST_CASE("sim: a host that is up again resets what it does not know, and serves anew") {
    ise::sim::world world;
    auto& shore = world.host("shore");
    auto& first = shore.start_process("proxy", server("tcp://shore:7400"));
    auto& boat = world.host("boat").start_process("boat");
    auto loop = boat.make_loop("main");
    std::error_code ended;
    spawn(loop->loop(), say_now_and_then(boat, loop->loop(), at("tcp://shore:7400"), ended));
    world.run_for(10s);
    CHECK_FALSE(ended);
    shore.crash();
    world.run_for(60s);
    CHECK_FALSE(ended);
    CHECK_THROWS_AS(first.restart(), std::logic_error); // the host is down
    shore.boot();
    auto& second = first.restart();
    CHECK(world.run_until([&] { return bool(ended); }, 1min));
    CHECK(ended == asio::error::connection_reset);
    CHECK(second.identity().host_key != first.identity().host_key);
    CHECK(second.identity().process_key != first.identity().process_key);
    CHECK(second.identity().process_id != first.identity().process_id);

    std::error_code again;
    bool connected = false;
    spawn(loop->loop(), hold(boat, loop->loop(), at("tcp://shore:7400"), again, connected));
    CHECK(world.run_until([&] { return connected; }, 1min));
}

TEST_CASE("sim: the same talk survives a kill at every step") {
    for (int step = 0; step < 60; ++step) {
        ise::sim::world world;
        auto& proxy = world.host("shore").start_process("proxy", server("tcp://0.0.0.0:7400"));
        auto& boat = world.host("boat").start_process("boat");
        auto loop = boat.make_loop("main");
        std::error_code ended;
        spawn(loop->loop(), say_now_and_then(boat, loop->loop(), at("tcp://shore:7400"), ended));
        int steps = 0;
        world.run_until([&] { return steps++ == step; });
        switch (step % 3) {
            case 0: proxy.crash(); break;
            case 1: boat.crash(); break;
            case 2: proxy.host().crash(); break;
        }
        world.run_for(30s);
        CHECK(proxy.running() == (step % 3 == 1));
        CHECK(boat.running() == (step % 3 != 1));
    }
}

} // namespace crash_test
