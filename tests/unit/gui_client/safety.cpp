// Land, fence and the calls of alarms: what keeps boat and operator out of trouble.
#include "packets.hpp"

#include <components/gui_client/leg_check.hpp>
#include <components/gui_client/words.hpp>

#include <support/catch.hpp>

#include <algorithm>
#include <cmath>
#include <random>

namespace safety_test {

using namespace console_test;

namespace {

const waypoint west{28.1530, -15.4480}, east{28.1600, -15.3900}; // the island between them
constexpr std::string_view bay = R"({"type":"Polygon","coordinates":[[[-15.475,28.145],[-15.44,28.145],[-15.44,28.17],
    [-15.475,28.17],[-15.475,28.145]]]})";

location sailing(waypoint where, float course, float speed) {
    auto made = at(where.latitude_deg, where.longitude_deg);
    made.course_over_ground_deg = course;
    made.speed_over_ground_mps = speed;
    return made;
}

boat_view boat_at(const waypoint& where) {
    boat_view made;
    made.position = heard<location>{at(where.latitude_deg, where.longitude_deg), t0, t0, link_id::xbee, 7};
    return made;
}

} // namespace

TEST_CASE("legs: of 100 random legs over land none goes up without an override, as an upload or as a telecommand") {
    auto sea = sea_limits::coast_only();
    std::mt19937 random(4);
    std::uniform_real_distribution<double> latitude(27.68, 28.22), longitude(-15.88, -15.33);
    auto place = [&] { return waypoint{latitude(random), longitude(random)}; };
    // Land on the way, by looking at it every 20 metres: another way than the check has.
    auto over_land = [&](const waypoint& a, const waypoint& b) {
        for (int i = 0; i <= 3500; ++i)
            if (sea->on_land({a.latitude_deg + (b.latitude_deg - a.latitude_deg) * i / 3500,
                              a.longitude_deg + (b.longitude_deg - a.longitude_deg) * i / 3500}))
                return true;
        return false;
    };
    int seen = 0, unwarned = 0;
    while (seen < 100) {
        auto a = place(), b = place();
        if (!over_land(a, b)) continue;
        ++seen;
        auto boat = boat_at(a);
        mission_view none, list;
        list.complete = true;
        list.points = {a};
        leg_context from_boat{*sea, boat, none}, behind{*sea, boat, list};
        unwarned += leg_trouble(from_boat, std::vector<waypoint>{b}).empty();
        unwarned += leg_trouble(from_boat, b).empty();
        unwarned += leg_trouble(from_boat, boat_command(commands::waypoint_add{b})).empty();
        unwarned += leg_trouble(behind, boat_command(commands::waypoint_add{b})).empty();
        unwarned += leg_trouble(behind, boat_command(commands::waypoint_insert{0, b})).empty();
        list.points = {b};
        unwarned += leg_trouble(behind, boat_command(commands::waypoint_select{0})).empty();
        unwarned += leg_trouble(behind, boat_command(commands::set_mode{sailing_mode::automatic})).empty();
    }
    CHECK(unwarned == 0);
}

TEST_CASE("legs: the reason names the leg, and what is in the water needs no override") {
    auto sea = sea_limits::coast_only();
    auto boat = boat_at(west);
    mission_view none;
    leg_context now{*sea, boat, none};
    std::vector<waypoint> t1{{28.1530, -15.4480}, {28.1600, -15.4520}, {28.1545, -15.4580}};
    CHECK(leg_trouble(now, t1).empty());
    CHECK(leg_trouble(now, t1[1]).empty());
    CHECK(leg_trouble(now, boat_command(commands::ping())).empty());
    auto why = leg_trouble(now, std::vector<waypoint>{west, east});
    CHECK(why.find("the leg from waypoint 1 to waypoint 2 crosses land after") == 0);
    CHECK(needs_override(why).find("; it takes an override") != std::string::npos);
    t1.insert(t1.begin() + 1, waypoint{28.1640, -15.4245}); // on La Isleta
    CHECK(leg_trouble(now, t1).find("waypoint 1 to waypoint 2 ends on land") != std::string::npos);
    // Removing the waypoint that leads around the island is a leg over it.
    mission_view list;
    list.complete = true;
    list.points = {west, {28.2100, -15.4100}, east};
    leg_context around{*sea, boat, list};
    CHECK_FALSE(leg_trouble(around, boat_command(commands::waypoint_delete{1})).empty());
    // A heading is checked as far as ten minutes.
    boat.sailing = heard<navigation>{navigation(), t0, t0, link_id::xbee, 7};
    boat.sailing->value.heading_deg = 90;
    CHECK(leg_trouble(now, boat_command(commands::set_mode{sailing_mode::hold})).empty());
    boat.position->value.speed_over_ground_mps = 3;
    CHECK(leg_trouble(now, boat_command(commands::set_mode{sailing_mode::hold})).find("heading 090° meets land") !=
          std::string::npos);
}

TEST_CASE("legs: a fence file counts on shore as aboard") {
    sea_limits fenced(geofence::parse(bay, "bay").value());
    auto boat = boat_at(west);
    mission_view none;
    leg_context now{fenced, boat, none};
    CHECK(leg_trouble(now, std::vector<waypoint>{{28.16, -15.452}}).empty());
    CHECK(leg_trouble(now, std::vector<waypoint>{{28.19, -15.46}}).find("ends outside the fence") != std::string::npos);
}

TEST_CASE("land: a course that meets it within ten minutes is a critical alarm, at least five minutes before") {
    for (double period : {2.0, 60.0, 240.0}) {
        console_state state;
        talker boat;
        auto sea = sea_limits::coast_only();
        coast_point start{28.1530, -15.4560};
        double land_m = *sea->metres_to_land(start, flat_destination(start, 95, 20'000)), speed = 1.4;
        double to_land_s = land_m / speed;
        REQUIRE(to_land_s > 700);
        std::optional<double> warned_s;
        for (double s = 0; s < to_land_s && !warned_s; s += 1) {
            auto now = t0 + std::chrono::milliseconds(static_cast<long long>(s * 1000));
            if (std::fmod(s, period) == 0) {
                auto where = flat_destination(start, 95, s * speed);
                navigation n;
                n.mode = sailing_mode::hold;
                state.on_telemetry(xbee_path, boat.say(n, now), now);
                state.on_telemetry(xbee_path,
                                   boat.say(sailing({where.latitude_deg, where.longitude_deg}, 95, 1.4f), now), now);
            }
            state.on_time(now);
            auto seen = state.view(now);
            if (const auto* land = find(seen->alarms, "land")) {
                CHECK(land->how == severity::critical);
                warned_s = to_land_s - s;
            }
        }
        INFO("telemetry every " << period << " s");
        REQUIRE(warned_s);
        CHECK(*warned_s >= 300);
        CHECK(*warned_s <= 605);
    }
}

TEST_CASE("land: in Auto the boat turns at its waypoint, and legs in the water call nobody") {
    console_state state;
    talker boat;
    std::vector<waypoint> t1{{28.1530, -15.4480}, {28.1600, -15.4520}, {28.1545, -15.4580}};
    waypoints list;
    list.revision = 1;
    list.count = 3;
    list.active = 0;
    list.entries = t1;
    state.on_telemetry(xbee_path, boat.say(list, t0), t0);
    navigation n;
    n.mode = sailing_mode::automatic;
    n.waypoint_count = 3;
    n.distance_to_waypoint_m = 300;
    n.bearing_to_waypoint_deg = 95;
    auto hear = [&](utc_time now) {
        state.on_telemetry(xbee_path, boat.say(n, now), now);
        state.on_telemetry(xbee_path, boat.say(sailing({28.1533, -15.4510}, 95, 4), now), now);
        state.on_time(now);
    };
    for (int s = 0; s < 60; ++s) hear(t0 + s * 1s);
    CHECK_FALSE(find(state.view(t0 + 60s)->alarms, "land"));
    n.mode = sailing_mode::hold; // the same course, and nobody turns
    for (int s = 60; s < 90; ++s) hear(t0 + s * 1s);
    REQUIRE(find(state.view(t0 + 90s)->alarms, "land"));
    n.mode = sailing_mode::automatic;
    for (int s = 90; s < 130; ++s) hear(t0 + s * 1s);
    CHECK(find(state.view(t0 + 130s)->alarms, "land")->over_at);
}

TEST_CASE("land: a turn that points at the shore for a moment calls nobody while there is time") {
    console_state state;
    talker boat;
    for (int s = 0; s < 120; ++s) {
        auto now = t0 + s * 1s;
        bool turns = s % 40 < 6;
        state.on_telemetry(xbee_path, boat.say(sailing({28.1533, -15.4520}, turns ? 95.f : 300.f, 4), now), now);
        state.on_time(now);
    }
    CHECK_FALSE(find(state.view(t0 + 120s)->alarms, "land"));
}

TEST_CASE("land: a position on land, one outside the fence and a boat that turned back are alarms") {
    state_options options;
    options.sea = std::make_shared<const sea_limits>(geofence::parse(bay, "bay").value());
    console_state state(options);
    talker boat;
    auto now = t0;
    auto hear = [&](const telemetry_body& body) {
        now += 2s;
        state.on_telemetry(xbee_path, boat.say(body, now), now);
        state.on_time(now);
    };
    hear(at(28.155, -15.455));
    CHECK(state.view(now)->alarms.empty());
    hear(at(28.1640, -15.4245));
    auto alarms = state.view(now)->alarms;
    REQUIRE(find(alarms, "land"));
    CHECK(find(alarms, "land")->text.find("on land") != std::string::npos);
    REQUIRE(find(alarms, "fence"));
    CHECK(find(alarms, "fence")->how == severity::critical);
    navigation n;
    n.at_fence = true;
    hear(n);
    CHECK(find(state.view(now)->alarms, "turned_back")->how == severity::warning);
}

TEST_CASE("bell: it calls within two seconds, again until somebody acknowledges, and for what becomes graver") {
    console_state state;
    talker boat;
    auto now = t0;
    std::vector<std::pair<double, severity>> calls;
    std::uint64_t heard = 0;
    auto run = [&](int seconds) { // as gui_client does: five times a second
        for (int i = 0; i < seconds * 5; ++i) {
            now += 200ms;
            if (i % 5 == 0) state.on_telemetry(xbee_path, boat.say(at(28.155, -15.455), now), now); // it is heard
            bool called = state.on_time(now);
            auto bell = state.view(now)->bell;
            CHECK(called == (bell.count != heard));
            if (bell.count == heard) continue;
            heard = bell.count;
            calls.emplace_back(std::chrono::duration<double>(now - t0).count(), bell.how);
        }
    };
    run(5);
    CHECK(calls.empty());
    power p;
    p.battery_percent = 15;
    state.on_telemetry(xbee_path, boat.say(p, now), now);
    run(20);
    REQUIRE(calls.size() == 1);
    CHECK(calls[0].first <= 5 + 2);
    CHECK(calls[0].second == severity::warning);
    run(45);
    CHECK(calls.size() == 3); // every 30 s
    p.battery_percent = 8;
    auto graver = now;
    state.on_telemetry(xbee_path, boat.say(p, now), now);
    run(21);
    REQUIRE(calls.size() == 8); // at once, then every 5 s
    CHECK(calls[3].first <= std::chrono::duration<double>(graver - t0).count() + 2);
    CHECK(calls[7].second == severity::critical);
    state.acknowledge("battery", now);
    run(60);
    CHECK(calls.size() == 8);
    // One that is over calls on until it is acknowledged: somebody must see it.
    p.battery_percent = 60;
    state.on_telemetry(xbee_path, boat.say(p, now), now);
    run(1);
    p.battery_percent = 15;
    state.on_telemetry(xbee_path, boat.say(p, now), now);
    run(1);
    p.battery_percent = 60;
    state.on_telemetry(xbee_path, boat.say(p, now), now);
    run(40);
    CHECK(calls.size() == 10);
}

TEST_CASE("bell: a notice calls once, and an alarm that was acknowledged before a restart not at all") {
    alarm_bell bell;
    alarm_book book;
    book.remember({{"battery", severity::warning}}, t0 + 600s);
    book.raise("battery", severity::warning, "low", t0);
    book.raise("names", severity::notice, "not reached", t0);
    int calls = 0;
    for (int s = 0; s < 120; ++s) calls += bell.update(book.list(), t0 + s * 1s) != nullptr;
    CHECK(calls == 1);
}

TEST_CASE("log of alarms: what happened, in order, bounded, and an unchanged one is the same object") {
    console_state state;
    talker boat;
    power p;
    p.battery_percent = 15;
    state.on_telemetry(xbee_path, boat.say(p, t0), t0);
    state.on_time(t0);
    CHECK(state.take_alarm_events().size() == 1);
    CHECK(state.take_alarm_events().empty());
    p.battery_percent = 5;
    state.on_telemetry(xbee_path, boat.say(p, t0 + 1s), t0 + 1s);
    state.on_time(t0 + 1s);
    state.acknowledge("", t0 + 2s);
    p.battery_percent = 90;
    state.on_telemetry(xbee_path, boat.say(p, t0 + 3s), t0 + 3s);
    state.on_time(t0 + 3s);
    auto log = state.view(t0 + 3s)->alarm_log;
    REQUIRE(log->size() == 4);
    std::vector<alarm_change> what;
    for (const auto& one : *log) what.push_back(one.what);
    CHECK(what ==
          std::vector{alarm_change::raised, alarm_change::more_severe, alarm_change::acknowledged, alarm_change::over});
    CHECK(log->back().at == t0 + 3s);
    CHECK(state.view(t0 + 3s)->alarm_log == log);
    CHECK(state.take_alarm_events().size() == 3);
    alarm_book book;
    for (int i = 0; i < 2000; ++i) book.tell("x", severity::notice, "y", t0 + i * 1s);
    CHECK(book.log()->size() == alarm_book::max_events);
}

TEST_CASE("authority: the request of a console that has gone goes, one of an operator without a console stays") {
    console_state state;
    state.set_self("atirma/console/anna");
    finding_view found;
    found.reached = true;
    state.on_finding(found);
    auto console = [](const char* name, bool self) {
        return present_component{
            std::string("atirma/console/") + name, "gui_client", "ready", "shore", 1, t0, true, self};
    };
    state.on_present({console("anna", true), console("ben", false)});
    authority_state result;
    result.epoch = 2;
    result.holder = "atirma/console/anna";
    result.asked_by = {"atirma/console/ben"};
    state.on_authority(result, t0);
    state.on_time(t0);
    CHECK(state.view(t0)->authority.state.asked_by.size() == 1);
    CHECK(find(state.view(t0)->alarms, "authority:asked"));
    state.on_present({console("anna", true)});
    state.on_time(t0 + 1s);
    CHECK(state.view(t0 + 1s)->authority.state.asked_by.empty());
    CHECK(find(state.view(t0 + 1s)->alarms, "authority:asked")->over_at);
    result.asked_by = {"atirma/operators/cli"};
    state.on_authority(result, t0 + 2s);
    CHECK(state.view(t0 + 2s)->authority.state.asked_by.size() == 1);
    found.reached = false; // nobody knows who is there
    state.on_finding(found);
    result.asked_by = {"atirma/console/ben"};
    state.on_authority(result, t0 + 3s);
    CHECK(state.view(t0 + 3s)->authority.state.asked_by.size() == 1);
}

TEST_CASE(
    "console: the time in a mode is counted anew from an order that renews it, and from the end of remote control") {
    console_state state;
    talker boat;
    navigation n;
    n.mode = sailing_mode::hold;
    auto reports = [&](utc_time when) { state.on_telemetry(xbee_path, boat.say(n, when), when + 1s); };
    auto executed = [&](std::uint32_t id, command_kind kind, ack_code result, utc_time when) {
        auto told = status(id, telecommand_stage::acknowledged, result);
        told.kind = kind;
        told.executed_at = when;
        state.on_status(xbee_path, told, when + 2s);
    };
    reports(t0);
    executed(1, command_kind::set_mode, ack_code::done, t0 + 600s);
    CHECK(state.boat().mode_since == t0 + 600s);
    executed(2, command_kind::set_mode, ack_code::refused, t0 + 610s);
    executed(3, command_kind::ping, ack_code::done, t0 + 620s);
    CHECK(state.boat().mode_since == t0 + 600s);
    reports(t0 + 640s);
    CHECK(state.boat().mode_since == t0 + 600s);
    n.remote_control = true;
    reports(t0 + 700s);
    reports(t0 + 710s);
    n.remote_control = false;
    reports(t0 + 720s);
    reports(t0 + 730s);
    CHECK(state.boat().mode_since == t0 + 720s);
    n.mode = sailing_mode::station_keep; // by itself
    reports(t0 + 900s);
    CHECK(state.boat().mode_since == t0 + 900s);
    executed(4, command_kind::set_mode, ack_code::done, t0 + 950s);
    n.mode = sailing_mode::manual; // the report comes later than the order
    reports(t0 + 990s);
    CHECK(state.boat().mode_since == t0 + 950s);
}

TEST_CASE("authority: a lower epoch is a node that lags, or after 30 s nodes that have begun anew") {
    console_state state;
    state.set_self("atirma/console/anna");
    authority_state result, lower;
    result.epoch = 9;
    result.holder = "atirma/console/anna";
    lower.epoch = 2;
    lower.holder = "atirma/console/ben";
    state.on_authority(result, t0);
    state.on_authority(lower, t0 + 1h); // the other node lags
    state.on_time(t0 + 1h + 29s);
    CHECK(state.authority().mine());
    state.on_authority(result, t0 + 1h + 29s);
    state.on_time(t0 + 1h + 40s);
    CHECK(state.authority().mine());
    CHECK_FALSE(find(state.view(t0 + 1h + 40s)->alarms, "authority:lost"));
    state.on_authority(lower, t0 + 2h);
    state.on_authority(lower, t0 + 2h + 20s);
    state.on_time(t0 + 2h + 31s);
    CHECK_FALSE(state.authority().mine());
    CHECK(state.authority().state.epoch == 2);
    CHECK(find(state.view(t0 + 2h + 31s)->alarms, "authority:lost"));
}

TEST_CASE("console: the time in a mode is counted from its first report") {
    console_state state;
    talker boat;
    navigation n;
    n.mode = sailing_mode::hold;
    state.on_telemetry(xbee_path, boat.say(n, t0), t0 + 1s);
    state.on_telemetry(xbee_path, boat.say(n, t0 + 60s), t0 + 61s);
    CHECK(state.boat().mode_since == t0);
    n.mode = sailing_mode::automatic;
    state.on_telemetry(xbee_path, boat.say(n, t0 + 90s), t0 + 91s);
    CHECK(state.boat().mode_since == t0 + 90s);
    CHECK(label(sailing_mode::hold) == "Heading");
    CHECK(label(sailing_mode::station_keep) == "Loiter");
    CHECK(label(sailing_mode::return_home) == "RTL");
}

} // namespace safety_test
