// What an operator tells the boat.
#include "console_desk.hpp"

using namespace console_test;

namespace {

void switch_air(sea& it, bool up) {
    it.user([up](ise::component& self) -> ise::task<> {
        xbee_air_request change;
        change.up = up;
        auto there = sea::air(self);
        co_await there.call(services::air_control, change, 5s);
    });
}

} // namespace

TEST_CASE("console: a mission is uploaded, read back and compared, also over lossy air") {
    sea it(11);
    desk console(it.world, "desk", at_the_proxy());
    REQUIRE(it.until([&] { return works(console); }));
    double loss = GENERATE(0.0, 0.3);
    it.user([loss](ise::component& self) -> ise::task<> {
        xbee_air_request lossy;
        lossy.extra_loss = loss;
        auto air = sea::air(self);
        co_await air.call(services::air_control, lossy, 5s);
    });
    upload_mission mission;
    mission.points = triangle;
    REQUIRE(console.port->act(mission));
    REQUIRE(it.until([&] { return is_running(console.see()->upload.phase); }));
    REQUIRE(it.until([&] { return !is_running(console.see()->upload.phase); }, 30min));
    INFO(console.see()->upload.text);
    CHECK(console.see()->upload.phase == upload_phase::verified);
    CHECK(same(it.boat().pilot().list(), triangle));
    CHECK(same(console.see()->mission.points, triangle));
    CHECK(console.see()->upload.done == triangle.size());
}

TEST_CASE("console: an upload is cancelled between two waypoints, and the boat keeps its list") {
    sea it;
    desk console(it.world, "desk", at_the_proxy());
    REQUIRE(it.until([&] { return works(console); }));
    const auto before = it.boat().pilot().list();
    upload_mission mission;
    mission.points = triangle;
    REQUIRE(console.port->act(mission));
    REQUIRE(it.until([&] { return console.see()->upload.done == 1; }, 10min));
    REQUIRE(console.port->act(cancel_upload()));
    REQUIRE(it.until([&] { return console.see()->upload.phase == upload_phase::cancelled; }, 10min));
    CHECK(console.see()->upload.text.find("of 4 waypoints: the boat keeps its list") != std::string::npos);
    it.world.run_for(10s); // what was under way has arrived, or has not
    CHECK(same(it.boat().pilot().list(), before));
}

TEST_CASE("console: an upload that hangs on a dead link is cancelled at once, and the next one is taken") {
    sea it;
    desk console(it.world, "desk", at_the_proxy());
    REQUIRE(it.until([&] { return works(console); }));
    switch_air(it, false);
    upload_mission mission;
    mission.points = triangle;
    REQUIRE(console.port->act(mission));
    REQUIRE(it.until([&] { return is_running(console.see()->upload.phase); }));
    it.world.run_for(30s);
    REQUIRE(is_running(console.see()->upload.phase)); // it waits for the boat
    REQUIRE(console.port->act(cancel_upload()));
    REQUIRE(it.until([&] { return console.see()->upload.phase == upload_phase::cancelled; }, 10s));
    CHECK(console.see()->upload.text.find("the boat keeps its list") != std::string::npos);
    switch_air(it, true);
    REQUIRE(console.port->act(mission));
    REQUIRE(it.until([&] { return console.see()->upload.phase == upload_phase::verified; }, 30min));
    CHECK(same(it.boat().pilot().list(), triangle));
}

TEST_CASE("console: an upload whose link dies after any packet leaves the boat its list, or the whole new one") {
    auto dies_after = GENERATE(0u, 1u, 2u, 3u, 4u); // the last: the new list was put into use
    sea it;
    desk console(it.world, "desk", at_the_proxy());
    REQUIRE(it.until([&] { return works(console); }));
    const auto before = it.boat().pilot().list();
    upload_mission mission;
    mission.points = triangle;
    REQUIRE(console.port->act(mission));
    auto one_of_both = [&] {
        auto list = it.boat().pilot().list();
        return same(list, before) || same(list, triangle);
    };
    REQUIRE(it.until(
        [&] {
            REQUIRE(one_of_both());
            return is_running(console.see()->upload.phase) && console.see()->upload.done >= dies_after;
        },
        10min));
    switch_air(it, false);
    REQUIRE(it.until(
        [&] {
            REQUIRE(one_of_both());
            return !is_running(console.see()->upload.phase);
        },
        30min));
    bool whole = same(it.boat().pilot().list(), triangle);
    auto phase = console.see()->upload.phase;
    CHECK((phase == upload_phase::failed || (whole && phase == upload_phase::differs))); // nothing can be read back
    if (dies_after == 0) CHECK_FALSE(whole);
}

TEST_CASE("console: a command that waits for a dead link is called back, and the boat never executes it") {
    sea it;
    desk console(it.world, "desk", at_the_proxy());
    REQUIRE(it.until([&] { return works(console); }));
    it.boat_process().crash();
    it.world.run_for(5s);
    switch_air(it, false);
    it.world.run_for(5s);
    auto hold = set_mode(sailing_mode::hold);
    hold.valid_s = 600;
    REQUIRE(console.port->act(hold));
    REQUIRE(it.until([&] { return console.last_command() && console.last_command()->phase >= command_phase::queued; }));
    CHECK(console.last_command()->valid_until);
    REQUIRE(console.port->act(call_back_command{console.last_command()->id}));
    REQUIRE(it.until([&] { return is_over(console.last_command()->phase); }, 1min));
    CHECK_FALSE(console.last_command()->called_back.empty());
    CHECK(console.last_command()->phase != command_phase::done);
}

TEST_CASE("console: a command that the link keeps beyond its time is not executed by the boat") {
    sea it;
    desk console(it.world, "desk", at_the_proxy());
    REQUIRE(it.until([&] { return works(console); }));
    switch_air(it, false);
    it.world.run_for(5s);
    auto hold = set_mode(sailing_mode::hold);
    hold.valid_s = 20;
    REQUIRE(console.port->act(hold));
    it.world.run_for(60s);
    switch_air(it, true);
    it.world.run_for(60s);
    CHECK(it.boat().pilot().mode() == sailing_mode::automatic);
    CHECK(is_over(console.last_command()->phase));
    REQUIRE(console.port->act(set_mode(sailing_mode::hold)));
    REQUIRE(it.until([&] { return console.last_command()->phase == command_phase::done; }, 2min));
    REQUIRE(console.last_command()->executed_at);
    CHECK(*console.last_command()->executed_at <= console.last_command()->changed_at);
}

TEST_CASE("console: the boat is sent to a place, and goes on with its list afterwards") {
    sea it;
    desk console(it.world, "desk", at_the_proxy());
    REQUIRE(it.until([&] { return works(console) && console.see()->mission.complete; }, 5min));
    auto before = console.see()->mission;
    REQUIRE(console.port->act(set_mode(sailing_mode::hold)));
    REQUIRE(it.until([&] { return it.boat().pilot().mode() == sailing_mode::hold; }));
    sail_to there;
    there.point = {28.1570, -15.4510};
    REQUIRE(console.port->act(there));
    REQUIRE(it.until([&] { return it.boat().pilot().mode() == sailing_mode::automatic; }, 5min));
    auto list = it.boat().pilot().list();
    REQUIRE(list.size() == before.points.size() + 1);
    CHECK(same({list[before.active]}, {there.point}));
    CHECK(it.boat().pilot().active() == before.active);
}

TEST_CASE("console: a parameter is pending while it is under way, then the boat's word stands") {
    sea it;
    desk console(it.world, "desk", at_the_proxy());
    REQUIRE(it.until([&] { return works(console); }));
    auto tack = [&] { return console.see()->parameters[static_cast<std::size_t>(parameter_id::time_to_next_tack)]; };
    give_command set;
    set.command = commands::set_parameter{parameter_id::time_to_next_tack, 45};
    REQUIRE(console.port->act(set));
    REQUIRE(it.until([&] { return tack().pending == 45.0f; }));
    REQUIRE(it.until([&] { return tack().confirmed == 45.0f && !tack().pending; }));
    CHECK(it.boat().pilot().parameter(parameter_id::time_to_next_tack) == 45.0f);
    set.command = commands::set_parameter{parameter_id::time_to_next_tack, 99999};
    REQUIRE(console.port->act(set));
    REQUIRE(it.until([&] { return !tack().problem.empty(); }));
    CHECK(tack().confirmed == 45.0f);
    CHECK(console.last_command()->phase == command_phase::refused);
}

TEST_CASE("console: the modem's power is set, and a value that is none is refused with the reason") {
    sea it;
    desk console(it.world, "desk", at_the_proxy());
    REQUIRE(it.until([&] { return works(console); }));
    set_xbee_parameter power;
    power.path = "tcp://shore:7411";
    power.name = "power_level";
    power.value = 1;
    REQUIRE(console.port->act(power));
    REQUIRE(it.until([&] { return console.see()->links[0].xbee && console.see()->links[0].xbee->power_level == 1; }));
    power.value = 9;
    REQUIRE(console.port->act(power));
    REQUIRE(it.until([&] { return console.see()->links[0].xbee_answer.find("not 9") != std::string::npos; }));
}

TEST_CASE("console: a newer order takes the place of one that waits at a proxy, also where no node records them") {
    sea it;
    desk console(it.world, "desk", at_the_proxy());
    REQUIRE(it.until([&] { return works(console); }));
    switch_air(it, false);
    it.world.run_for(5s);
    REQUIRE(console.port->act(set_mode(sailing_mode::return_home)));
    REQUIRE(it.until([&] { return console.last_command() && console.last_command()->phase >= command_phase::queued; }));
    auto older = console.last_command()->id;
    auto entry = [&](std::uint32_t id) {
        auto all = console.see()->commands;
        return *std::ranges::find(*all, id, &command_entry::id);
    };
    SECTION("the proxy goes on") {
        REQUIRE(console.port->act(set_mode(sailing_mode::hold)));
        REQUIRE(it.until([&] { return is_over(entry(older).phase); }, 1min));
        CHECK(entry(older).text.find("replaced by telecommand") != std::string::npos);
        switch_air(it, true);
        REQUIRE(it.until([&] { return console.last_command()->phase == command_phase::done; }, 5min));
        CHECK(it.boat().pilot().mode() == sailing_mode::hold); // the modem may have sent the older one, before
    }
    SECTION("the proxy is started anew, and knows nothing of the older one") {
        it.proxy_process().crash();
        it.world.run_for(2s);
        REQUIRE(console.port->act(call_back_command{older}));
        it.world.run_for(2s);
        it.proxy_process().restart();
        it.world.run_for(20s);
        switch_air(it, true);
        it.world.run_for(2min);
        CHECK(it.boat().pilot().mode() == sailing_mode::automatic);
        CHECK(entry(older).phase == command_phase::expired);
    }
}
