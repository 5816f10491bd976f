// kill -9 of either side at every event of a session, from the first hello to the goodbye, and a new life after it.
#include "crash_sea.hpp"

#include <array>
#include <cstdlib>
#include <iostream>

namespace crash_sweeps_test {

using namespace crash_test;
using ise::execution;

namespace {

constexpr auto none = static_cast<std::size_t>(-1);

struct totals {
    std::size_t kills = 0, not_executed = 0, unknown = 0, answered = 0, unknown_gaps = 0, given_up = 0;
};

class sea {
public:
    explicit sea(const std::string& scheme) : where_(scheme + "://" + world.host("boat").address() + ":7400") {
        boat_ = &world.host("boat").start_process(
            "boat", [this](ise::sim::process& self) { return std::make_shared<provider>(self, noted, where_); });
        world.run_for(10ms);
        alone_ = boat().busy();
        other_ = start("other", false);
        REQUIRE(world.run_until([&] { return of("other").heard > 3; }, 10s));
        shore_ = start("shore", true);
    }

    // From the first hello until the provider has forgotten it; gives how many events that took until then, or until
    // the kill.
    std::size_t sail(std::size_t kill_at, bool kills_provider) {
        std::size_t events = 0;
        world.run_until([&] { return events++ == kill_at || over(); }, 1min);
        if (!over()) {
            REQUIRE(events == kill_at + 1);
            auto& victim = kills_provider ? boat_ : shore_;
            if (!kills_provider) noted.give_up("shore");
            victim->crash();
            // At once, before anybody has noticed, and after everything that waits for it has given up.
            constexpr std::array away{20ms, 700ms, 4000ms};
            world.run_for(away[kill_at % away.size()]);
            victim = &victim->restart();
        }
        bool finished = world.run_until([&] { return of("shore").finished; }, 1min);
        for (const auto& problem : of("shore").at.escaped) UNSCOPED_INFO(problem);
        REQUIRE(finished);
        return events;
    }

    void check(bool killed, bool kills_provider, totals& all) {
        world.run_for(settled);
        CHECK(of("shore").at.services->sessions().empty());
        CHECK(of("shore").at.services->calls().open_calls() == 0);
        CHECK(of("shore").at.scope.running() == std::vector<std::string>());
        CHECK(world.host("shore").datagrams.empty());
        CHECK(boat().at.services->sessions().size() == 1); // the other's
        CHECK(boat().out.subscribers() == 1);

        auto& other = of("other");
        CHECK(other.unknown_gaps == (killed && kills_provider ? 1 : 0));
        CHECK(other.lost == 0);
        CHECK(of("shore").lost == 0);
        auto before = other.heard;
        world.run_for(1s);
        CHECK(other.heard >= before + 49);
        all.unknown_gaps += static_cast<std::size_t>(of("shore").unknown_gaps);

        other.calls_on = false;
        CHECK(world.run_until([&] { return !other.waits(); }, 2s));
        leave(other.at);
        CHECK(other.at.services->calls().open_calls() == 0);
        world.run_for(settled);
        CHECK(boat().at.services->sessions().empty());
        CHECK(boat().out.subscribers() == 0);
        CHECK(boat().at.services->calls().open_calls() == 0);
        CHECK(boat().busy() == alone_);
        auto said = world.trace().count();
        world.run_for(10s);
        CHECK(world.trace().count() == said); // not even to whom has gone
        leave(boat().at);
        leave(of("shore").at);
        CHECK(world.run_until_idle(1min));
        for (auto* one : {&boat().at, &other.at, &of("shore").at}) CHECK(one->escaped.empty());
        check_calls(killed && kills_provider, all);
    }

private:
    bool over() { return of("shore").finished && boat().at.services->sessions().size() == 1; }
    provider& boat() { return *noted.boat; }
    client& of(const std::string& name) { return *noted.clients.at(name); }
    ise::sim::process* start(const std::string& name, bool sails) {
        return &world.host(name).start_process(name, [this, name, sails](ise::sim::process& self) {
            return std::make_shared<client>(self, noted, name, where_, sails);
        });
    }
    void leave(ise_test::party& who) {
        who.services->stop(1s);
        who.scope.stop();
        CHECK(world.run_until([&] { return who.scope.size() == 0; }, 1min));
    }
    void check_calls(bool provider_killed, totals& all) {
        for (const auto& [name, call] : noted.calls) {
            INFO(name << (call.why ? ": " + call.why->message() : std::string()));
            CHECK(call.runs <= 1);
            CHECK(call.outcomes == (call.given_up ? 0 : 1));
            if (call.given_up) {
                ++all.given_up;
                continue;
            }
            CHECK(call.ended <= call.deadline);
            if (!call.why) {
                ++all.answered;
                CHECK(call.runs == 1);
                CHECK(call.same);
                continue;
            }
            CHECK(provider_killed);
            if (call.why->executed() == execution::not_executed) {
                ++all.not_executed;
                CHECK(call.runs == 0);
            } else {
                ++all.unknown;
            }
        }
    }

    book noted;
    ise::sim::world world;
    std::string where_;
    ise::sim::process *boat_ = nullptr, *shore_ = nullptr, *other_ = nullptr;
    std::size_t alone_ = 0;
};

// Every event of the beginning and of the end; those between, which carry the big message, in steps.
totals sweep(const std::string& scheme, bool kills_provider) {
    totals all;
    std::size_t events = 0;
    {
        totals undisturbed;
        sea it(scheme);
        events = it.sail(none, kills_provider);
        it.check(false, kills_provider, undisturbed);
    }
    for (std::size_t at = 0; at + 1 < events; at += at < 250 || at + 60 > events ? 1 : 7) {
        INFO(scheme << ", killed at event " << at << " of " << events);
        sea it(scheme);
        it.sail(at, kills_provider);
        it.check(true, kills_provider, all);
        ++all.kills;
    }
    if (std::getenv("ISE_TEST_FIGURES"))
        std::cout << scheme << ", " << (kills_provider ? "provider" : "client") << " killed at " << all.kills << " of "
                  << events << " events: " << all.answered << " calls answered, " << all.not_executed
                  << " not executed, " << all.unknown << " unknown, " << all.given_up << " of the killed, "
                  << all.unknown_gaps << " gaps of unknown length\n";
    return all;
}

} // namespace

TEST_CASE("crash: a provider is killed at every event of a session and comes back as a new one") {
    auto scheme = GENERATE(as<std::string>(), "tcp", "udp");
    auto all = sweep(scheme, true);
    CHECK(all.not_executed > all.kills);
    CHECK(all.unknown > all.kills);
    CHECK(all.unknown_gaps > all.kills / 2);
}

TEST_CASE("crash: a client is killed at every event of a session and comes back as a new one") {
    auto scheme = GENERATE(as<std::string>(), "tcp", "udp");
    auto all = sweep(scheme, false);
    CHECK(all.given_up > all.kills / 2);
    CHECK(all.unknown + all.not_executed == 0); // the other was answered every time
}

} // namespace crash_sweeps_test
