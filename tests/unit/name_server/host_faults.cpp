// What a host does to its programs: its clock is set, it stops them and lets them go on.
#include "system.hpp"

namespace host_faults_test {

using namespace names_test;

namespace {

// Calls all the time; counts what came and what failed.
struct console {
    std::uint64_t answered = 0, failed = 0, heard = 0, lost = 0;

    ise::sim::process& start(names_test::system& in, const std::string& name = "console") {
        return in.start_body("shore", name, [this](ise::component& self) -> ise::task<> {
            auto doubler = co_await self.find("atirma/doubler");
            self.spawn("listens", listen(doubler, *this));
            for (;;) {
                number rq{4};
                auto got = co_await doubler.try_call(twice, rq, 1s);
                ++(got ? answered : failed);
                co_await self.sleep(100ms);
            }
        });
    }
    static ise::task<> listen(ise::remote doubler, console& self) {
        auto counts = co_await doubler.subscribe(count);
        for (;;) {
            auto packet = co_await counts.next();
            if (!packet) co_return;
            ++self.heard;
            self.lost += packet.lost_before().value();
        }
    }
};

} // namespace

TEST_CASE("host: a wall clock that is set forwards, back or before all time disturbs nothing") {
    auto scheme = GENERATE(as<std::string>(), "tcp", "udp");
    INFO(scheme);
    names_test::system it;
    auto& boat = it.start_doubler("boat", "atirma/doubler", scheme + "://0.0.0.0:0");
    console seen;
    seen.start(it);
    REQUIRE(it.world.run_until([&] { return seen.answered > 3 && seen.heard > 3; }, 10s));
    auto epoch = it.epoch_of("atirma/doubler");
    for (auto step : {ise::duration(24h), ise::duration(-24h), ise::duration(24h * 365 * 50),
                      ise::duration(-24h * 365 * 100), ise::duration(0)}) {
        for (auto* one : {&boat, it.server}) {
            one->set_wall_offset(step);
            auto answered = seen.answered, heard = seen.heard;
            it.world.run_for(10s);                         // five leases
            CHECK(it.epoch_of("atirma/doubler") == epoch); // never lost, so never granted anew
            CHECK(seen.answered >= answered + 90);
            CHECK(seen.heard >= heard + 90);
            console late; // and who comes only now is let in
            auto& process = late.start(it, "late");
            CHECK(it.world.run_until([&] { return late.answered > 3 && late.heard > 3; }, 5s));
            process.crash();
        }
    }
    CHECK(seen.failed == 0);
    CHECK(seen.lost == 0);
}

TEST_CASE("host: a process that was stopped for longer than its lease heals when it goes on") {
    auto scheme = GENERATE(as<std::string>(), "tcp", "udp");
    INFO(scheme);
    names_test::system it;
    auto& boat = it.start_doubler("boat", "atirma/doubler", scheme + "://0.0.0.0:0");
    console seen;
    seen.start(it);
    REQUIRE(it.world.run_until([&] { return seen.answered > 3 && seen.heard > 3; }, 10s));
    auto stopped_s = GENERATE(1, 3, 60, 3600);
    INFO("stopped for " << stopped_s << " s");
    boat.pause();
    it.world.run_for(std::chrono::seconds(stopped_s));
    if (stopped_s > 4) CHECK_FALSE(it.holds("atirma/doubler"));
    boat.go_on();
    auto answered = seen.answered, heard = seen.heard;
    CHECK(it.world.run_until(
        [&] { return it.holds("atirma/doubler") && seen.answered > answered + 10 && seen.heard > heard + 10; }, 30s));
}

TEST_CASE(
    "host: a name server that was stopped for longer than all leases takes none for lost that it could not hear") {
    names_test::system it;
    it.start_doubler("boat", "atirma/doubler");
    console seen;
    seen.start(it);
    REQUIRE(it.world.run_until([&] { return seen.answered > 3; }, 10s));
    it.server->pause();
    it.world.run_for(60s);
    it.server->go_on();
    auto failed = seen.failed;
    CHECK(failed == 0); // who has found each other needs nobody in between
    CHECK(it.world.run_until([&] { return it.holds("atirma/doubler") && it.holds("test/console"); }, 10s));
    it.world.run_for(10s);
    CHECK(it.holds("atirma/doubler"));
    CHECK(seen.failed == 0);
}

} // namespace host_faults_test
