#include "packets.hpp"

#include <components/gui_client/fleet_watch.hpp>

#include <support/catch.hpp>

namespace fleet_watch_test {

using namespace console_test;

namespace {

std::shared_ptr<const snapshot> with_battery(console_state& state, talker& talk, unsigned percent, utc_time now) {
    power supply;
    supply.battery_percent = static_cast<std::uint8_t>(percent);
    state.on_telemetry(xbee_path, talk.say(supply, now - 1s), now);
    state.on_time(now);
    return state.view(now);
}

} // namespace

TEST_CASE("console fleet: an alarm of a boat that is not shown calls the operator, once for each call of its bell") {
    fleet_watch fleet({"A-Tirma", "boat-2"});
    console_state first, second;
    talker one, two;
    fleet.take(0, with_battery(first, one, 80, t0));
    fleet.take(1, with_battery(second, two, 80, t0));
    CHECK_FALSE(fleet.next_call());
    fleet.take(1, with_battery(second, two, 5, t0 + 1s));
    auto call = fleet.next_call();
    REQUIRE(call);
    CHECK(call->boat == 1);
    CHECK(call->how == severity::critical);
    CHECK(call->text.find("5 %") != std::string::npos);
    CHECK_FALSE(fleet.next_call());
    fleet.take(1, with_battery(second, two, 5, t0 + 3s));
    CHECK_FALSE(fleet.next_call());
    fleet.take(1, with_battery(second, two, 5, t0 + 7s)); // not acknowledged: it calls again
    CHECK(fleet.next_call());
    second.acknowledge("", t0 + 8s);
    fleet.take(1, with_battery(second, two, 5, t0 + 20s));
    CHECK_FALSE(fleet.next_call());
}

TEST_CASE("console fleet: of two boats that call at once the more severe alarm is told, and both count as heard") {
    fleet_watch fleet({"A-Tirma", "boat-2"});
    console_state first, second;
    talker one, two;
    fleet.take(0, with_battery(first, one, 15, t0)); // a warning
    fleet.take(1, with_battery(second, two, 5, t0));
    auto call = fleet.next_call();
    REQUIRE(call);
    CHECK(call->boat == 1);
    CHECK_FALSE(fleet.next_call());
}

TEST_CASE("console fleet: open alarms are sorted by severity, then the shown boat, then the newest") {
    fleet_watch fleet({"A-Tirma", "boat-2", "boat-3"});
    auto with = [](std::vector<alarm_entry> alarms) {
        auto made = std::make_shared<snapshot>();
        made->alarms = std::move(alarms);
        return made;
    };
    auto alarm = [](std::string text, severity how, utc_time at, bool acknowledged = false) {
        return alarm_entry{text, how, text, at, std::nullopt, acknowledged};
    };
    fleet.take(0, with({alarm("a", severity::warning, t0), alarm("seen", severity::critical, t0, true)}));
    fleet.take(1, with({alarm("b", severity::critical, t0), alarm("c", severity::warning, t0 + 9s)}));
    fleet.take(2, with({alarm("d", severity::critical, t0 + 1s), alarm("e", severity::warning, t0 + 2s)}));
    auto order = [&](std::size_t shown) {
        std::string made;
        for (const auto& one : fleet.open_alarms(shown)) made += one.alarm.text;
        return made;
    };
    CHECK(order(0) == "dbace");
    CHECK(order(1) == "bdcea");
    auto open = count_open(*fleet.seen(0));
    CHECK(open.count == 1);
    REQUIRE(open.worst);
    CHECK(open.worst->key == "a");
    CHECK(count_open(*fleet.seen(1)).worst->key == "b");
    CHECK_FALSE(fleet_watch({"alone"}).open_alarms(0).size());
}

TEST_CASE(
    "console fleet: what a component that has ended left behind is no open alarm, and the shown boat comes first") {
    fleet_watch fleet({"A-Tirma", "boat-2", "boat-3"});
    console_state second;
    talker two;
    fleet.take(1, with_battery(second, two, 5, t0));
    REQUIRE(fleet.open_alarms(0).size() == 1);
    CHECK_FALSE(fleet.first_ended(0));
    fleet.end(1, "its name is taken");
    CHECK(fleet.open_alarms(0).empty());
    CHECK(fleet.first_ended(0) == 1);
    fleet.end(2, "its name is lost");
    CHECK(fleet.first_ended(0) == 1);
    CHECK(fleet.first_ended(2) == 2);
    CHECK(fleet.ended(2) == "its name is lost");
    CHECK(fleet.ended(0).empty());
}

TEST_CASE("console fleet: the log has the events of all boats once, by time, and goes on after a restart of one") {
    fleet_watch fleet({"A-Tirma", "boat-2"});
    console_state first, second;
    talker one, two;
    fleet.take(1, with_battery(second, two, 5, t0));
    fleet.take(0, with_battery(first, one, 5, t0 + 1s));
    auto events = fleet.take_events();
    REQUIRE(events.size() == 2);
    CHECK(events[0].boat == 1);
    CHECK(events[1].boat == 0);
    CHECK(fleet.labelled(1, "x") == "boat-2: x");
    CHECK(fleet.take_events().empty());
    second.acknowledge("", t0 + 2s);
    fleet.take(1, second.view(t0 + 2s));
    events = fleet.take_events();
    REQUIRE(events.size() == 1);
    CHECK(events[0].event.what == alarm_change::acknowledged);
    console_state restarted;
    fleet.take(1, with_battery(restarted, two, 5, t0 + 9s));
    events = fleet.take_events();
    REQUIRE(events.size() == 1);
    CHECK(events[0].event.what == alarm_change::raised);
    CHECK(fleet_watch({"alone"}).labelled(0, "x") == "x");
}

} // namespace fleet_watch_test
