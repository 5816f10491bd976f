// kill -9 of the name server, or of a component, at every event of a component's registration, of its being looked up,
// of its renewals and of its leaving; and a new life after it.
#include "system.hpp"

#include <ise/service/service_host.hpp>

#include <cstdlib>
#include <iostream>

namespace crash_sweeps_test {

using namespace names_test;

namespace {

constexpr std::string_view path = "atirma/doubler", role = "atirma/gateway", spare = "shore/spare",
                           bystander = "a/bystander";
constexpr auto none = static_cast<std::size_t>(-1);

// What a client of a path or a role sees.
struct onlooker {
    std::uint64_t answered = 0, failed = 0, heard = 0, lost = 0;
    int unknown_gaps = 0;
    std::string holder;

    static ise::task<> call(ise::component& self, std::string whom, onlooker& into, ise::duration deadline) {
        auto there = self.at(whom, ise::role_options::failback_after(1s));
        for (;;) {
            number asked{21};
            auto got = co_await there.try_call(twice, asked, deadline);
            if (got) CHECK(got->value == 42);
            ++(got ? into.answered : into.failed);
            into.holder = there.holder();
            co_await self.sleep(100ms);
        }
    }
    static ise::task<> listen(ise::component& self, std::string whom, onlooker& into) {
        auto there = self.at(whom);
        ise::subscribe_options patient;
        patient.deadline = 1h;
        auto numbers = co_await there.subscribe(count, patient);
        for (;;) {
            auto packet = co_await numbers.next();
            if (!packet) co_return;
            ++into.heard;
            if (auto lost = packet.lost_before()) into.lost += *lost;
            else ++into.unknown_gaps;
        }
    }
};

struct story {
    names_test::system it;
    onlooker of_path, of_role, of_bystander;
    ise::sim::process* victim = nullptr;
    ise::node* victims_node = nullptr;
    std::uint64_t granted = 0, bystanders_epoch = 0; // the highest so far

    story() {
        it.start_doubler("stander", std::string(bystander));
        member("spare", spare, 5);
        it.start_body("shore", "console", [this](ise::component& self) -> ise::task<> {
            self.spawn("calls the path", onlooker::call(self, std::string(path), of_path, 20s));
            self.spawn("listens to the path", onlooker::listen(self, std::string(path), of_path));
            self.spawn("calls the role", onlooker::call(self, std::string(role), of_role, 20s));
            self.spawn("calls the bystander", onlooker::call(self, std::string(bystander), of_bystander, 1s));
            self.spawn("listens to the bystander", onlooker::listen(self, std::string(bystander), of_bystander));
            co_await self.sleep(100h);
        });
        REQUIRE(it.world.run_until(
            [&] { return of_role.answered > 2 && of_bystander.answered > 2 && of_bystander.heard > 2; }, 10s));
        bystanders_epoch = it.epoch_of(std::string(bystander));
    }
    ise::sim::process* member(const std::string& host, std::string_view called, std::int32_t priority) {
        return &it.start(host, "member", [this, host, called, priority](ise::node& node) {
            auto options = everywhere();
            options.roles[std::string(role)] = priority;
            node.start<doubler>(std::string(called), options);
            if (host == "boat") victims_node = &node;
        });
    }
    void come() { victim = member("boat", path, 10); }
    bool come_in_full() {
        come();
        return it.world.run_until([&] { return of_path.heard > 2 && of_role.holder == path; }, 20s);
    }

    // Runs for this long, or up to the event; gives how many there were.
    std::size_t run(ise::duration time, std::size_t stop_at) {
        std::size_t events = 0;
        auto end = it.world.now() + time;
        it.world.run_until([&] { return events++ == stop_at || it.world.now() >= end; }, time);
        return events;
    }
    // At any time: an epoch never falls, and the bystander keeps its own.
    void run_and_look(ise::duration time) {
        for (auto end = it.world.now() + time; it.world.now() < end;) {
            look();
            it.world.run_for(50ms);
        }
        look();
    }
    void look() {
        if (auto now = it.epoch_of(std::string(path)); now != 0) {
            CHECK(now >= granted);
            granted = now;
        }
        if (auto now = it.epoch_of(std::string(bystander)); now != 0) CHECK(now == bystanders_epoch);
    }
    template <class Done>
    bool look_until(Done done, ise::duration within) {
        for (auto end = it.world.now() + within; !done() && it.world.now() < end;) run_and_look(50ms);
        return done();
    }
    // Who had nothing to do with it has noticed nothing.
    void check_bystander() const {
        CHECK(of_bystander.failed == 0);
        CHECK(of_bystander.lost == 0);
        CHECK(of_bystander.unknown_gaps == 0);
        CHECK(it.epoch_of(std::string(bystander)) == bystanders_epoch);
    }
    // Every name is held, calls and roles go to whom they should.
    void check_whole() {
        CHECK(look_until(
            [&] {
                return it.holds(std::string(path)) && it.holds(std::string(spare)) && it.holds(std::string(bystander));
            },
            5s));
        auto answered = of_path.answered, heard = of_path.heard;
        CHECK(look_until(
            [&] { return of_path.answered > answered + 2 && of_path.heard > heard + 2 && of_role.holder == path; },
            30s));
        auto epoch = it.epoch_of(std::string(path));
        run_and_look(5s); // more than two leases
        CHECK(it.epoch_of(std::string(path)) == epoch);
        CHECK(of_path.failed == 0); // each had its 20 s
        CHECK(of_role.failed == 0);
        check_bystander();
    }
};

constexpr std::array away{20ms, 700ms, 6000ms};
constexpr ise::duration lease = 2s;

// That there are where nobody is killed.
auto events_of_coming() {
    story undisturbed;
    undisturbed.come();
    return undisturbed.run(1500ms, none);
}

} // namespace

TEST_CASE("crash: the name server is killed at every event while a component comes, is looked up and renews its name") {
    const auto events = events_of_coming();
    if (std::getenv("ISE_TEST_FIGURES")) std::cout << events << " events\n";
    CHECK(events > 200);
    for (std::size_t at = 0; at + 1 < events; ++at) {
        INFO("killed at event " << at << " of " << events);
        story run;
        run.come();
        run.run(1500ms, at);
        run.look();
        auto before = run.granted;
        auto gaps = run.of_path.unknown_gaps;
        run.it.server->crash();
        run.run_and_look(away[at % away.size()]);
        run.it.restart_server();
        run.check_whole();
        if (before != 0) CHECK(run.granted == before); // it has lived all the time
        CHECK(run.of_path.unknown_gaps == gaps);
        CHECK(run.of_path.lost == 0);
    }
}

TEST_CASE("crash: a component is killed at every event while it comes, is looked up and renews its name") {
    int gaps = 0;
    const auto events = events_of_coming();
    for (std::size_t at = 0; at + 1 < events; ++at) {
        INFO("killed at event " << at << " of " << events);
        story run;
        run.come();
        run.run(1500ms, at);
        run.look();
        auto before = run.granted;
        bool was_heard = run.of_path.heard > 0;
        run.victim->crash();
        auto pause = away[at % away.size()];
        if (pause > 2 * lease) {
            CHECK(run.look_until([&] { return !run.it.holds(std::string(path)); }, 2 * lease));
            CHECK(run.look_until([&] { return run.of_role.holder == spare; }, 1s));
        }
        run.run_and_look(pause);
        run.victim = &run.victim->restart();
        CHECK(run.look_until([&] { return run.it.epoch_of(std::string(path)) > before; }, 2 * lease));
        CHECK(run.of_role.failed <= 1); // what it was answering
        CHECK(run.of_path.failed <= 1);
        run.of_role.failed = run.of_path.failed = 0;
        run.check_whole();
        CHECK(run.granted > before);
        if (was_heard) CHECK(run.of_path.unknown_gaps == 1);
        gaps += run.of_path.unknown_gaps;
    }
    CHECK(gaps > 50);
}

TEST_CASE("crash: the name server or the component is killed at every event while the component leaves") {
    auto server = GENERATE(true, false);
    auto events = [] {
        story undisturbed;
        REQUIRE(undisturbed.come_in_full());
        undisturbed.victims_node->stop();
        return undisturbed.run(300ms, none);
    }();
    if (std::getenv("ISE_TEST_FIGURES")) std::cout << events << " events\n";
    CHECK(events > 20);
    for (std::size_t at = 0; at + 1 < events; at += 3) {
        INFO((server ? "name server" : "component") << " killed at event " << at << " of " << events);
        story run;
        REQUIRE(run.come_in_full());
        run.look();
        run.victims_node->stop();
        run.run(300ms, at);
        (server ? run.it.server : run.victim)->crash();
        run.run_and_look(away[at % away.size()]);
        if (server) run.it.restart_server();
        CHECK(run.look_until([&] { return run.of_role.holder == spare && run.it.holds(std::string(spare)); }, 10s));
        run.run_and_look(2 * lease);
        CHECK_FALSE(run.it.holds(std::string(path)));
        run.check_bystander();
        CHECK(run.of_role.failed <= 1);
        run.victim = run.member("boat2", path, 10); // whoever comes next is the later one
        auto before = run.granted;
        CHECK(run.look_until([&] { return run.it.epoch_of(std::string(path)) > before; }, 2 * lease));
    }
}

} // namespace crash_sweeps_test
