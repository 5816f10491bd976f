#include "sea.hpp"

namespace failures_test {

using namespace sea;
using ise::component;
using ise::component_state;

namespace {

ise::component_options with_policy(fleet& all, ise::on_failure policy) {
    auto options = all.listening("boat");
    options.policy = policy;
    return options;
}

task<> sail_on(component& self) { co_await self.sleep(1h); }

task<> run_aground(component& self) {
    co_await self.sleep(1s);
    throw std::runtime_error("aground");
}

// Uses itself before it was started.
class hasty final : public component {
public:
    explicit hasty(int which) {
        switch (which) {
            case 0: provide(echo, [](question) { return reply{}; }); break;
            case 1: publish(readings); break;
            case 2: publish_every(readings, 1s, [] { return reading{}; }); break;
            case 3: log().info("hello"); break;
            case 4: now(); break;
            case 5: wall(); break;
            case 6: path(); break;
            case 7: spawn("sleep", sleep(1s)); break;
            case 8: at("atirma/boat"); break;
            case 9: services(); break;
            default: break;
        }
    }

protected:
    task<> run() override { co_return; }
};

} // namespace

TEST_CASE("a component that uses itself in its constructor gets an error that says where it belongs") {
    auto which = GENERATE(range(0, 10));
    CAPTURE(which);
    try {
        hasty made(which);
        FAIL("it could be made");
    } catch (const ise::error& why) {
        CHECK(why.code() == ise::errc::invalid_argument);
        CHECK_THAT(std::string(why.what()), ise_test::Contains("do it in run(), not in the constructor"));
    }
}

TEST_CASE("an exception that escapes is reported with the component's and the coroutine's name") {
    fleet all;
    std::string coroutine = "run";
    SECTION("from run, before it suspends") {
        all.start("boat", "atirma/boat", [](component&) -> task<> {
            throw std::runtime_error("aground");
            co_return;
        });
    }
    SECTION("from run, later") { all.start("boat", "atirma/boat", run_aground); }
    SECTION("from a spawned coroutine") {
        coroutine = "the mate";
        all.start("boat", "atirma/boat", [](component& self) -> task<> {
            self.spawn("the mate", run_aground(self));
            co_await self.sleep(1h);
        });
    }
    SECTION("from the maker of a periodic packet") {
        coroutine = "readings";
        all.start("boat", "atirma/boat", [](component& self) -> task<> {
            self.publish_every(readings, 1s, []() -> reading { throw std::runtime_error("aground"); });
            co_return;
        });
    }
    SECTION("from a listener's callback") {
        coroutine = "readings";
        all.node("buoy").start<beacon>("buoy", all.listening("buoy"));
        all.start("boat", "atirma/boat", [](component& self) -> task<> {
            self.listen(self.at(fleet::at("buoy")), readings,
                        [](const reading&) { throw std::runtime_error("aground"); });
            co_return;
        });
    }
    all.start("boat", "other", sail_on, 7001);
    REQUIRE(all.world.run_until([&] { return all.state("boat", "atirma/boat") == component_state::failed; }, 1min));
    CHECK(all.report("boat", "atirma/boat").failure == coroutine + ": aground");
    CHECK(all.log.has("error   atirma/boat: an exception escaped", "cause=aground"));
    CHECK(all.state("boat", "other") == component_state::ready);
}

TEST_CASE("a listener that is refused fails its component with the reason") {
    fleet all;
    all.start("buoy", "buoy", sail_on);
    all.start("boat", "boat", [](component& self) -> task<> {
        self.listen(self.at(fleet::at("buoy")), readings, [](const reading&) {});
        co_return;
    });
    REQUIRE(all.world.run_until([&] { return all.state("boat", "boat") == component_state::failed; }, 1min));
    CHECK(all.report("boat", "boat").failure.find("readings") != std::string::npos);
}

TEST_CASE("what a handler throws is the caller's failure, not the component's") {
    fleet all;
    all.start("boat", "boat", [](component& self) -> task<> {
        self.provide(echo, [](question) -> reply { throw std::runtime_error("no echo at sea"); });
        self.provide(ask_back, [&self](question) -> task<reply> {
            co_await self.sleep(1s);
            throw std::runtime_error("nor here");
        });
        co_return;
    });
    all.run("shore", [](component& self) -> task<> {
        auto boat = self.at(fleet::at("boat"));
        question asked{"?"};
        auto plain = co_await boat.try_call(echo, asked, 5s);
        auto later = co_await boat.try_call(ask_back, asked, 5s);
        REQUIRE(!plain);
        REQUIRE(!later);
        CHECK(plain.error().code() == ise::errc::handler_failed);
        CHECK(later.error().code() == ise::errc::handler_failed);
        CHECK(plain.error().message().find("no echo at sea") != std::string::npos);
        CHECK(later.error().message().find("nor here") != std::string::npos);
    });
    CHECK(all.state("boat", "boat") == component_state::ready);
}

TEST_CASE("the log names a caller without a name within the host for what it is, not by the provider's own address") {
    fleet all;
    auto listen = GENERATE(as<std::string>(), "inproc://boat", "local://@boat");
    ise::component_options there;
    there.listen = {ise::endpoint::parse(listen).value()};
    all.node("boat").start(
        "boat",
        [](component& self) -> task<> {
            self.provide(echo, [](question) -> reply { throw std::runtime_error("no echo at sea"); });
            co_return;
        },
        there);
    ise::component_options nobody;
    nobody.listens = false;
    bool over = false;
    all.node("boat").start(
        "",
        [&](component& self) -> task<> {
            auto boat = self.at(ise::endpoint::parse(listen).value());
            question asked{"?"};
            auto answer = co_await boat.try_call(echo, asked, 5s);
            CHECK(!answer);
            over = true;
        },
        nobody);
    REQUIRE(all.world.run_until([&] { return over; }, 1min));
    auto who = listen.starts_with("inproc") ? "a component without a name in the same process"
                                            : "a component without a name on the same host";
    CHECK(all.log.has("a handler of 'echo' failed: no echo at sea", who));
    CHECK_FALSE(all.log.has("a handler of 'echo' failed", listen));
}

TEST_CASE("a failure stops the whole node where it was told so") {
    fleet all;
    all.start("boat", "other", sail_on, 7001);
    all.node("boat").start("boat", run_aground, with_policy(all, ise::on_failure::stop_node));
    REQUIRE(all.world.run_until([&] { return all.node("boat").all_stopped(); }, 1min));
    CHECK(all.state("boat", "boat") == component_state::failed);
    CHECK(all.state("boat", "other") == component_state::stopped);
}

TEST_CASE("a component that is restarted provides its services anew and its clients heal") {
    fleet all;
    int lives = 0;
    std::vector<std::uint64_t> heard;
    all.node("boat").start(
        "boat",
        [&](component& self) -> task<> {
            ++lives;
            self.provide(echo, [life = lives](question) { return reply{std::to_string(life)}; });
            self.publish_every(readings, 100ms, [&] { return reading{static_cast<std::uint64_t>(lives)}; });
            co_await self.sleep(5s);
            if (lives < 3) throw std::runtime_error("aground");
        },
        with_policy(all, ise::on_failure::restart));
    all.start("shore", "shore", [&](component& self) -> task<> {
        self.listen(self.at(fleet::at("boat")), readings,
                    [&](const reading& packet) { heard.push_back(packet.number); });
        co_return;
    });
    all.run("shore", [](component& self) -> task<> {
        auto boat = self.at(fleet::at("boat"));
        std::string last;
        while (last != "3") { // what was sent when it failed may fail; the next call waits for the next life
            question asked{"?"};
            auto answer = co_await boat.try_call(echo, asked, 30s);
            if (answer) last = answer->text;
            else CHECK(answer.error().code() == ise::errc::peer_lost);
            co_await self.sleep(100ms);
        }
    });
    REQUIRE(all.world.run_until([&] { return !heard.empty() && heard.back() == 3; }, 1min));
    CHECK(std::set<std::uint64_t>(heard.begin(), heard.end()) == std::set<std::uint64_t>{1, 2, 3});
    CHECK(all.state("boat", "boat") == component_state::ready);
    CHECK(all.state("shore", "shore") == component_state::ready);
    REQUIRE(all.stop("boat"));
    auto report = all.report("boat", "boat");
    CHECK(report.restarts == 2);
    CHECK(report.failure.empty()); // it was mended
    CHECK(all.state("boat", "boat") == component_state::stopped);
}

TEST_CASE("restarts come later and later, and end when the component is stopped") {
    fleet all;
    std::vector<ise::time_point> began;
    all.node("boat").start(
        "boat",
        [&](component& self) -> task<> {
            began.push_back(self.now());
            throw std::runtime_error("aground");
            co_return;
        },
        with_policy(all, ise::on_failure::restart));
    all.world.run_for(5min);
    REQUIRE(began.size() > 8);
    CHECK(began[1] - began[0] <= 200ms);
    CHECK(began.back() - began[began.size() - 2] >= 15s);
    REQUIRE(all.stop("boat"));
    auto count = began.size();
    all.world.run_for(5min);
    CHECK(began.size() == count);
}

TEST_CASE("a component whose last flow does not end cannot be restarted and says so") {
    census frames;
    fleet all;
    all.node("boat").start(
        "boat",
        [&](component& self) -> task<> {
            auto mule = [](component& whose, census& among) -> task<> {
                census::citizen alive(among);
                co_await ise::this_task::ignore_cancellation;
                co_await whose.sleep(24h);
            };
            self.spawn("the mule", mule(self, frames));
            co_await self.sleep(1s);
            throw std::runtime_error("aground");
        },
        with_policy(all, ise::on_failure::restart));
    REQUIRE(all.world.run_until([&] { return all.state("boat", "boat") == component_state::failed; }, 1min));
    CHECK(all.log.has("cannot be restarted", "the mule"));
    CHECK(all.report("boat", "boat").still_running == std::vector<std::string>{"the mule"});
}

TEST_CASE("a component that is stopped while its restart waits for its last flow drops nobody else's coroutines") {
    census frames;
    fleet all;
    all.node("boat").start(
        "boat",
        [](component& self) -> task<> {
            auto mule = [](component& whose) -> task<> {
                co_await ise::this_task::ignore_cancellation;
                co_await whose.sleep(1500ms);
            };
            self.spawn("the mule", mule(self));
            co_await self.sleep(1s);
            throw std::runtime_error("aground");
        },
        with_policy(all, ise::on_failure::restart));
    auto beside = all.listening("boat", 7001);
    beside.together_with = "boat";
    all.node("boat").start(
        "mate",
        [&](component& self) -> task<> {
            auto stubborn = [](component& whose, census& among) -> task<> {
                census::citizen alive(among);
                ise::waiter<> never(whose.on(), ise::uninterrupted);
                co_await never.wait();
            };
            self.spawn("stubborn", stubborn(self, frames));
            co_await self.sleep(24h);
        },
        beside);
    all.world.run_for(1200ms);
    all.node("boat").stop("boat");
    REQUIRE(all.world.run_until([&] { return all.state("boat", "boat") == component_state::failed; }, 1min));
    CHECK(all.report("boat", "boat").still_running.empty());
    CHECK(all.report("boat", "boat").restarts == 0);
    CHECK(frames.alive == 1);
    all.drop("boat");
    CHECK(frames.alive == 0);
}

} // namespace failures_test
