#include "sea.hpp"

#include <ise/asio.hpp>

#include <asio/detached.hpp>

namespace states_test {

using namespace sea;
using ise::component;
using ise::component_state;

namespace {

class slow_starter : public component {
public:
    explicit slow_starter(int& count) : told_(count) { announce_when_ready(); }

private:
    task<> run() override {
        for (int n = 0; n < 3; ++n) spawn("waits", wait_ready());
        provide(echo, [](question asked) { return reply{asked.text}; });
        co_await sleep(10s);
        co_await ready();
        ++told_;
    }
    task<> wait_ready() {
        co_await sleep(11s);
        co_await ready();
        ++told_;
    }
    int& told_;
};

} // namespace

TEST_CASE("a component is ready at its first suspension, and stopped when it was stopped") {
    fleet all;
    auto& boat = all.start("boat", "boat", [](component& self) -> task<> { co_await self.sleep(1h); });
    CHECK(boat.state() == component_state::starting);
    all.world.run_for(1s);
    CHECK(boat.state() == component_state::ready);
    CHECK(boat.path() == "boat");
    REQUIRE(all.stop("boat"));
    CHECK(boat.state() == component_state::stopped); // the object stays as long as the node
    CHECK(all.report("boat", "boat").failure.empty());
}

TEST_CASE("a component that announces itself is starting until it says that it is ready, to all who wait") {
    fleet all;
    int count = 0;
    auto& boat = all.node("boat").start<slow_starter>("boat", all.listening("boat"), count);
    all.world.run_for(9s);
    CHECK(boat.state() == component_state::starting);
    all.world.run_for(5s);
    CHECK(boat.state() == component_state::ready);
    CHECK(count == 4);
}

TEST_CASE("a component that takes its time is stopping meanwhile") {
    fleet all;
    bool cleaned = false;
    auto& boat = all.start("boat", "boat", [&](component& self) -> task<> {
        bool stopped = false;
        try {
            co_await self.sleep(1h);
        } catch (const std::exception&) {
            stopped = true;
        }
        if (!stopped) co_return;
        co_await ise::this_task::forget_cancellation;
        co_await self.sleep(1s); // takes the sails in
        cleaned = true;
    });
    all.world.run_for(1s);
    all.node("boat").stop();
    all.world.run_for(500ms);
    CHECK(boat.state() == component_state::stopping);
    REQUIRE(all.stop("boat"));
    CHECK(cleaned);
    CHECK(all.report("boat", "boat").still_running.empty());
}

TEST_CASE("whoever awaits the end of a node goes on when its last component has stopped") {
    fleet all;
    bool reported = false;
    all.start(
        "boat", "one", [](component& self) -> task<> { co_await self.sleep(1h); }, 7001);
    all.start(
        "boat", "two", [](component& self) -> task<> { co_await self.sleep(1h); }, 7002);
    auto wait = [](ise::node& whose, bool& done) -> task<> {
        co_await whose.stopped();
        done = true;
    };
    ise::async_run(all.world.context().get_executor(), wait(all.node("boat"), reported), asio::detached);
    all.world.run_for(1s);
    all.node("boat").stop("one");
    all.world.run_for(10s);
    CHECK(all.state("boat", "one") == component_state::stopped);
    CHECK(all.state("boat", "two") == component_state::ready);
    CHECK(!reported);
    all.node("boat").stop("two");
    CHECK(all.world.run_until([&] { return reported; }, 1min));
}

TEST_CASE("a variable that is no endpoint is named by the node that reads it") {
    fleet all;
    auto& process = all.process("boat");
    process.set_variable("ISE_NAME_SERVER", "127.0.0.1:7400");
    std::string message;
    try {
        ise::node node(process);
    } catch (const ise::error& thrown) {
        CHECK(thrown.code() == ise::errc::invalid_argument);
        message = thrown.what();
    }
    CHECK(message.find("ISE_NAME_SERVER") != std::string::npos);
    CHECK(message.find("tcp://127.0.0.1:7400") != std::string::npos); // how it is written
}

TEST_CASE("who starts a component without a name server is told what is missing") {
    fleet all;
    all.process("boat").set_variable("ISE_NAME_SERVER", "tcp://boat:7400"); // nobody listens there
    ise::node_options options;
    options.log = all.log.sink();
    ise::node node(all.process("boat"), options);
    node.start<beacon>("beacon");
    CHECK(all.world.run_until([&] { return all.log.has("is not reached; retrying", "ise_name_server"); }, 1min));
    CHECK(all.log.has("ISE_NAME_SERVER", "tcp://boat:7400"));
}

} // namespace states_test
