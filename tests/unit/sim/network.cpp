#include "talk.hpp"

#include <support/catch.hpp>

namespace network_test {

using namespace talk;

namespace {

struct side {
    ise::sim::process& env;
    std::unique_ptr<ise::loop_host> host = env.make_loop("main");
    ise::loop& loop = host->loop();
};

task<> send_text(ise::environment& env, ise::loop& on, ise::endpoint to, std::string text, std::error_code& problem) {
    auto made = co_await env.connect(on, to);
    if (!made) co_return;
    problem = co_await write_all(**made, text);
    (*made)->shutdown_write();
    std::string answer;
    auto ended = co_await read_all(**made, answer);
    if (!problem && ended != asio::error::eof) problem = ended;
}

task<> take_text(ise::environment& env, ise::loop& on, ise::endpoint where, std::string& into, std::error_code& ended,
                 ise::duration pause) {
    auto channel = env.listen(on, where);
    if (!channel) co_return;
    auto [problem, client] = co_await (*channel)->accept();
    if (problem) {
        ended = problem;
        co_return;
    }
    co_await sleep(on, pause);
    ended = co_await read_all(*client, into);
}

std::string long_text(std::size_t size) {
    std::string text;
    for (std::size_t i = 0; text.size() < size; ++i) text += std::to_string(i) + ",";
    text.resize(size);
    return text;
}

// A transfer, and how it went.
struct transfer_of {
    ise::sim::world world;
    side shore{world.host("shore").start_process("proxy")};
    side boat{world.host("boat").start_process("boat")};
    std::string text, got;
    std::error_code sent, ended;

    transfer_of(std::uint64_t seed, std::size_t size) : world(seed), text(long_text(size)) {}
    void start(ise::duration pause = {}) {
        spawn(shore.loop, take_text(shore.env, shore.loop, at("tcp://0.0.0.0:7400"), got, ended, pause));
        spawn(boat.loop, send_text(boat.env, boat.loop, at("tcp://10.0.0.1:7400"), text, sent));
    }
};

std::uint64_t trace_of(std::uint64_t seed) {
    transfer_of run(seed, 200'000);
    auto& link = run.world.net().between("boat", "shore");
    link.latency = 20ms;
    link.jitter = 15ms;
    link.loss = 0.2;
    run.start();
    CHECK(run.world.run_until([&] { return bool(run.ended); }));
    CHECK(run.got == run.text);
    run.world.note("random", "boat", run.boat.env.random());
    return run.world.trace().hash();
}

} // namespace

TEST_CASE("sim: equal seeds replay exactly, others differ") {
    const auto first = trace_of(7);
    CHECK(first == trace_of(7));
    CHECK(first != trace_of(8));
    CHECK(first == 0x70d73e88c0038a05u); // the same from every compiler
}

TEST_CASE("sim: what a process draws does not depend on the others") {
    ise::sim::world one(3), two(3), other(4);
    two.host("a").start_process("first").random();
    const auto drawn = one.host("b").start_process("it").random();
    CHECK(drawn == two.host("b").start_process("it").random());
    CHECK(drawn != other.host("b").start_process("it").random());
    CHECK(drawn != one.host("b").start_process("it").random()); // another life
}

TEST_CASE("sim: a slow link takes its time, and the sender is told to wait") {
    transfer_of run(1, 300'000);
    auto& link = run.world.net().between("boat", "shore");
    link.bandwidth_bytes_per_second = 10'000;
    run.start();
    REQUIRE(run.world.run_until([&] { return bool(run.ended); }));
    CHECK(run.got == run.text);
    CHECK(run.world.elapsed() > 30s);
    CHECK(run.world.elapsed() < 31s);
}

TEST_CASE("sim: a reader that does not read holds the sender, not the world") {
    transfer_of run(1, 300'000);
    run.start(1h);
    run.world.run_for(30min);
    const auto arrived = run.world.net().delivered(ise::sim::direction::to_server);
    CHECK(arrived == run.world.net().between("boat", "shore").receive_buffer_bytes);
    REQUIRE(run.world.run_until([&] { return bool(run.ended); }, 2h));
    CHECK(run.got == run.text);
}

TEST_CASE("sim: bytes stall in a partition and go on after it") {
    transfer_of run(1, 300'000);
    run.world.net().between("boat", "shore").bandwidth_bytes_per_second = 100'000;
    run.world.at(1s, [&] { run.world.net().partition("boat", "shore"); });
    run.world.at(100s, [&] { run.world.net().heal("boat", "shore"); });
    run.start();
    run.world.run_for(99s);
    CHECK(run.got.size() > 50'000);
    CHECK(run.got.size() < 150'000);
    CHECK_FALSE(run.ended);
    REQUIRE(run.world.run_until([&] { return bool(run.ended); }));
    CHECK(run.got == run.text);
}

TEST_CASE("sim: a connection is cut after exactly the byte that was asked for") {
    constexpr std::size_t size = 40;
    std::uint64_t n = 0;
    for (;; ++n) {
        transfer_of run(1, size);
        run.world.net().cut("boat", "shore", ise::sim::direction::to_server, n);
        run.start();
        REQUIRE(run.world.run_until([&] { return bool(run.ended); }, 1min));
        if (run.world.net().cuts() == 0) break;
        CHECK(run.got == run.text.substr(0, n));
        CHECK(run.ended == asio::error::connection_reset);
        run.world.run_for(1min);
        CHECK(run.sent == asio::error::connection_reset);
    }
    CHECK(n == size + 1);
}

TEST_CASE("sim: any single operation may fail, and nothing hangs or leaks") {
    std::uint64_t n = 0;
    for (;; ++n) {
        transfer_of run(1, 100'000);
        run.world.fail_at(n);
        run.start();
        run.world.run_for(1min);
        if (!run.world.faults().failed()) {
            CHECK(run.got == run.text);
            break;
        }
    }
    CHECK(n > 8);
}

TEST_CASE("sim: ports belong to a host, and port 0 is any free one") {
    ise::sim::world world;
    side shore{world.host("shore").start_process("proxy")};
    side twin{world.host("shore").start_process("twin")};
    side boat{world.host("boat").start_process("boat")};
    auto first = shore.env.listen(shore.loop, at("tcp://0.0.0.0:7400"));
    REQUIRE(first);
    CHECK(shore.env.listen(shore.loop, at("tcp://127.0.0.1:7400")).error().code() == ise::errc::address_in_use);
    CHECK(twin.env.listen(twin.loop, at("tcp://shore:7400")).error().code() == ise::errc::address_in_use);
    CHECK(boat.env.listen(boat.loop, at("tcp://0.0.0.0:7400")));
    CHECK(boat.env.listen(boat.loop, at("tcp://10.0.0.1:7400")).error().code() == ise::errc::io_failed); // the shore's
    auto any = twin.env.listen(twin.loop, at("tcp://localhost:0"));
    auto more = twin.env.listen(twin.loop, at("tcp://localhost:0"));
    REQUIRE(any);
    REQUIRE(more);
    CHECK((*any)->where().port != 0);
    CHECK((*any)->where().port != (*more)->where().port);
    CHECK((*any)->where().host == "127.0.0.1");
    *first = nullptr;
    CHECK(twin.env.listen(twin.loop, at("tcp://shore:7400")));
    auto held = twin.env.listen(twin.loop, at("local:///run/x.sock"));
    CHECK(shore.env.listen(shore.loop, at("local:///run/x.sock")).error().code() == ise::errc::address_in_use);
    CHECK(shore.env.identity().host_key == twin.env.identity().host_key);
    CHECK(shore.env.identity().host_key != boat.env.identity().host_key);
}

TEST_CASE("sim: what listens on loopback or on a local path is not reached from elsewhere") {
    ise::sim::world world;
    side shore{world.host("shore").start_process("proxy")};
    side boat{world.host("boat").start_process("boat")};
    std::string got;
    std::error_code sent, ended;
    const std::string where = GENERATE("tcp://127.0.0.1:7400", "local://@x", "tcp://[::1]:7400");
    spawn(shore.loop, take_text(shore.env, shore.loop, at(where), got, ended, {}));
    spawn(boat.loop, send_text(boat.env, boat.loop, at(where), "hello", sent));
    spawn(boat.loop, send_text(boat.env, boat.loop, at("tcp://shore:7400"), "hello", sent));
    world.run_for(1min);
    CHECK(got == "");
    spawn(shore.loop, send_text(shore.env, shore.loop, at(where), "hello", sent));
    world.run_for(1min);
    CHECK(got == "hello");
}

TEST_CASE("sim: a process has variables, files and a wall clock") {
    ise::sim::world world;
    world.wall_start = ise::wall_time(std::chrono::hours(24));
    auto& host = world.host("shore");
    auto& it = host.start_process("proxy", {}, {{"ISE_NAME_SERVER", "tcp://shore:7400"}});
    host.write_file("/etc/ise.toml", "a = 1");
    CHECK(it.variable("ISE_NAME_SERVER") == "tcp://shore:7400");
    CHECK(it.variable("HOME") == std::nullopt);
    CHECK(it.read_file("/etc/ise.toml", 100).value() == "a = 1");
    CHECK(it.read_file("/etc/ise.toml", 4).error().code() == ise::errc::too_large);
    CHECK(it.read_file("/etc/none", 4).error().code() == ise::errc::io_failed);
    world.run_for(90s);
    it.set_wall_offset(1s);
    CHECK(it.wall() == world.wall_start + 91s);
    CHECK(it.interface_addresses() == std::vector<std::string>{"10.0.0.1"});
}

} // namespace network_test
