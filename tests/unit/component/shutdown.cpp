#include "sea.hpp"

#include <ise/service/peer_channel.hpp>

namespace shutdown_test {

using namespace sea;
using ise::component;
using ise::component_state;

namespace {

task<> sail_on(component& self) { co_await self.sleep(1h); }

task<> refuse_to_end(component& self, census& frames) {
    census::citizen alive(frames);
    co_await ise::this_task::ignore_cancellation;
    for (;;) co_await self.sleep(1min);
}

} // namespace

TEST_CASE("a coroutine that refuses to end is named, and stops neither its component nor the others") {
    census frames;
    fleet all;
    all.start("boat", "stubborn", [&](component& self) -> task<> {
        self.spawn("the mule", refuse_to_end(self, frames));
        self.spawn("the horse", sail_on(self));
        co_await self.sleep(1h);
    });
    all.start("boat", "meek", sail_on, 7001);
    all.world.run_for(1s);
    auto began = all.world.now();
    REQUIRE(all.stop("boat"));
    CHECK(all.world.now() - began <= 3 * all.grace);
    CHECK(all.report("boat", "stubborn").still_running == std::vector<std::string>{"the mule"});
    CHECK(all.report("boat", "meek").still_running.empty());
    CHECK(all.log.has("did not end in time", "the mule"));
    CHECK(frames.alive == 1);
    all.drop("boat");
    CHECK(frames.alive == 0);
}

TEST_CASE("peers of a component that stops learn why, and calls in progress end on both sides") {
    census handlers;
    fleet all;
    bool listening = false;
    std::string said;
    ise::errc code{};
    all.start("boat", "boat", [&](component& self) -> task<> {
        self.provide(echo, [&](question) -> task<reply> {
            census::citizen alive(handlers);
            listening = true;
            co_await self.sleep(1h);
            co_return reply{};
        });
        co_return;
    });
    all.start("shore", "shore", [&](component& self) -> task<> {
        auto boat = self.at(fleet::at("boat"));
        question asked{"?"};
        auto answer = co_await boat.try_call(echo, asked, 30s);
        if (answer) co_return;
        code = answer.error().code();
        said = answer.error().message();
    });
    REQUIRE(all.world.run_until([&] { return listening; }));
    SECTION("when it stops") {
        REQUIRE(all.stop("boat"));
        REQUIRE(all.world.run_until([&] { return code != ise::errc{}; }, 1s));
        CHECK((code == ise::errc::peer_lost || code == ise::errc::cancelled));
        INFO(said);
        CHECK((said.find("stop") != std::string::npos || said.find("cancel") != std::string::npos));
        CHECK(handlers.alive == 0);
        CHECK(all.report("boat", "boat").still_running.empty());
    }
    SECTION("when the caller stops") {
        REQUIRE(all.stop("shore"));
        REQUIRE(all.world.run_until([&] { return handlers.alive == 0; }, 1s));
        CHECK(all.report("shore", "shore").still_running.empty());
    }
    SECTION("when the provider's node is destroyed without more ado") {
        all.drop("boat");
        CHECK(handlers.alive == 0);
        all.world.run_for(1min);
        CHECK(code != ise::errc{});
    }
    SECTION("when the caller's node is destroyed without more ado") {
        all.drop("shore");
        CHECK(all.world.run_until([&] { return handlers.alive == 0; }, 1min));
    }
    SECTION("when both stop at once") {
        all.node("boat").stop();
        all.node("shore").stop();
        CHECK(all.stop("boat"));
        CHECK(all.stop("shore"));
        CHECK(handlers.alive == 0);
    }
}

TEST_CASE("a session ends with a goodbye that carries the reason") {
    fleet all;
    all.node("boat").start<beacon>("boat", all.listening("boat"));
    std::string way;
    all.start("shore", "shore", [&](component& self) -> task<> {
        auto boat = self.at(fleet::at("boat"));
        auto packets = co_await boat.subscribe(readings);
        while (packets.connected()) co_await self.sleep(10ms);
        way = boat.way().obstacle();
        CHECK(!packets.ended()); // it waits for the provider's next life
    });
    all.world.run_for(5s);
    REQUIRE(all.stop("boat"));
    REQUIRE(all.world.run_until([&] { return !way.empty(); }, 5s));
    CHECK(way.find("the component stops") != std::string::npos);
}

TEST_CASE("a subscription goes on when its provider was stopped and started again") {
    fleet all;
    std::vector<std::uint64_t> heard;
    all.node("boat").start<beacon>("boat", all.listening("boat"));
    all.start("shore", "shore", [&](component& self) -> task<> {
        self.listen(self.at(fleet::at("boat")), readings,
                    [&](const reading& packet) { heard.push_back(packet.number); });
        co_return;
    });
    REQUIRE(all.world.run_until([&] { return heard.size() == 5; }, 1min));
    REQUIRE(all.stop("boat"));
    all.world.run_for(10s);
    all.node("boat").start<beacon>("boat", all.listening("boat"));
    REQUIRE(all.world.run_until([&] { return heard.size() == 10; }, 1min));
    CHECK(all.state("boat", "boat") == component_state::ready);
    CHECK(all.node("boat").components().size() == 1);
}

TEST_CASE("stopping twice, from inside and at the start all end the same") {
    fleet all;
    SECTION("twice") {
        all.start("boat", "boat", sail_on);
        all.world.run_for(1s);
        all.node("boat").stop();
        all.node("boat").stop("boat");
        all.node("boat").stop();
    }
    SECTION("before its first step") {
        all.start("boat", "boat", sail_on);
        all.node("boat").stop();
    }
    SECTION("in its first step") {
        all.start("boat", "boat", [](component& self) -> task<> {
            self.stop();
            self.stop();
            co_await self.sleep(1h);
        });
    }
    SECTION("from a handler, whose answer still leaves") {
        all.start("boat", "boat", [](component& self) -> task<> {
            self.provide(echo, [&](question) {
                self.stop();
                return reply{"farewell"};
            });
            co_return;
        });
        all.run("shore", [](component& self) -> task<> {
            auto boat = self.at(fleet::at("boat"));
            question asked{"?"};
            auto answer = co_await boat.call(echo, asked, 5s);
            CHECK(answer.text == "farewell");
        });
    }
    SECTION("from a coroutine that is cancelled by it") {
        all.start("boat", "boat", [](component& self) -> task<> {
            co_await self.sleep(1s);
            self.stop();
            co_await self.sleep(1h);
        });
        all.world.run_for(2s);
    }
    SECTION("and nothing is stopped where nothing is") { all.node("boat").stop("nobody"); }
    REQUIRE(all.stop("boat"));
    for (const auto& report : all.node("boat").reports()) {
        CHECK(report.still_running.empty());
        CHECK(report.failure.empty());
    }
    all.node("boat").stop();
}

TEST_CASE("what a component is asked after its stop is refused, not kept waiting") {
    fleet all;
    auto& boat = all.start("boat", "boat", sail_on);
    all.world.run_for(1s);
    REQUIRE(all.stop("boat"));
    census frames;
    boat.spawn("late", refuse_to_end(boat, frames));
    all.world.run_for(1s);
    CHECK(frames.alive == 0);
}

} // namespace shutdown_test
