#include "packets.hpp"

#include <support/catch.hpp>

namespace alarms_test {

using namespace console_test;

TEST_CASE("console: an alarm stays until it is over and acknowledged, in either order") {
    alarm_book book;
    book.raise("battery", severity::warning, "low", t0);
    book.clear("battery", t0 + 1s);
    REQUIRE(book.find("battery"));
    CHECK(book.find("battery")->over_at == t0 + 1s);
    CHECK(book.acknowledge("battery"));
    CHECK_FALSE(book.find("battery"));
    book.raise("battery", severity::warning, "low", t0 + 2s);
    CHECK(book.acknowledge(""));
    REQUIRE(book.find("battery"));
    CHECK(book.find("battery")->acknowledged);
    book.clear("battery", t0 + 3s);
    CHECK_FALSE(book.find("battery"));
    CHECK_FALSE(book.acknowledge("battery"));
}

TEST_CASE("console: an alarm that becomes graver, or comes back, is to be acknowledged again") {
    alarm_book book;
    book.raise("battery", severity::warning, "19 %", t0);
    book.acknowledge("battery");
    book.raise("battery", severity::warning, "18 %", t0 + 1s);
    CHECK(book.find("battery")->acknowledged);
    CHECK(book.find("battery")->text == "18 %");
    book.raise("battery", severity::critical, "9 %", t0 + 2s);
    CHECK_FALSE(book.find("battery")->acknowledged);
    book.clear("battery", t0 + 3s);
    book.raise("battery", severity::warning, "15 %", t0 + 4s);
    CHECK_FALSE(book.find("battery")->over_at);
    CHECK(book.find("battery")->raised_at == t0 + 4s);
}

TEST_CASE("console: the alarms are bounded, and the gravest that is not acknowledged comes first") {
    alarm_book book;
    for (int i = 0; i < 200; ++i) book.tell("event " + std::to_string(i), severity::notice, "x", t0 + i * 1s);
    CHECK(book.list().size() == alarm_book::max_alarms);
    CHECK(book.dropped() == 200 - alarm_book::max_alarms);
    CHECK(book.find("event 199"));
    book.raise("no_data", severity::critical, "silence", t0);
    CHECK(book.list().front().key == "no_data");
    book.acknowledge("no_data");
    CHECK(book.list().back().key == "no_data");
}

TEST_CASE("console: the battery calls below its limit, and does not flutter there") {
    console_state state;
    talker boat;
    auto charge = [&](std::uint8_t percent, utc_time when) {
        power p;
        p.battery_percent = percent;
        state.on_telemetry(xbee_path, boat.say(p, when), when);
        state.on_time(when);
        return find(state.view(when)->alarms, "battery") != nullptr &&
               !find(state.view(when)->alarms, "battery")->over_at;
    };
    CHECK_FALSE(charge(25, t0));
    CHECK(charge(19, t0 + 1s));
    CHECK(charge(21, t0 + 2s));
    CHECK_FALSE(charge(26, t0 + 3s));
    CHECK(charge(8, t0 + 4s));
    CHECK(find(state.view(t0 + 4s)->alarms, "battery")->how == severity::critical);
    CHECK(charge(12, t0 + 5s));
    CHECK(find(state.view(t0 + 5s)->alarms, "battery")->how == severity::critical);
    CHECK(charge(16, t0 + 6s));
    CHECK(find(state.view(t0 + 6s)->alarms, "battery")->how == severity::warning);
    CHECK(charge(12, t0 + 7s));
    CHECK(find(state.view(t0 + 7s)->alarms, "battery")->how == severity::warning);
}

TEST_CASE("console: in irons, off track, faults and a new boot call the operator") {
    console_state state;
    talker boat;
    navigation n;
    n.mode = sailing_mode::automatic;
    n.waypoint_count = 2;
    n.in_irons = true;
    n.cross_track_error_m = -75;
    power p;
    p.battery_percent = 80;
    p.faults = 0x0010;
    state.on_telemetry(xbee_path, boat.say(n, t0), t0);
    state.on_telemetry(xbee_path, boat.say(p, t0), t0);
    state.on_time(t0);
    auto alarms = state.view(t0)->alarms;
    REQUIRE(find(alarms, "irons"));
    CHECK(find(alarms, "irons")->how == severity::critical);
    REQUIRE(find(alarms, "off_track"));
    CHECK(find(alarms, "off_track")->text == "Off track: 75 m left of the leg");
    CHECK(find(alarms, "faults")->text.find("0010") != std::string::npos);
    CHECK_FALSE(find(alarms, "boot"));
    n.mode = sailing_mode::hold; // there is no track to be off
    n.in_irons = false;
    boat.boot = 8;
    state.on_telemetry(xbee_path, boat.say(n, t0 + 2s), t0 + 2s);
    state.on_time(t0 + 2s);
    alarms = state.view(t0 + 2s)->alarms;
    CHECK(find(alarms, "irons")->over_at);
    CHECK(find(alarms, "off_track")->over_at);
    CHECK(find(alarms, "boot"));
}

TEST_CASE("console: a restart of the boat is reported even if its packet comes at once, or after one from the future") {
    console_state state;
    talker boat;
    auto early = boat.say(at(28.1, -15.4), t0);
    early.measured_at = t0 + 24h; // the boat's clock was wrong
    state.on_telemetry(xbee_path, early, t0 + 1s);
    boat.boot = 8;
    auto packet = boat.say(at(28.1, -15.4), t0 + 60s);
    state.on_telemetry(xbee_path, packet, packet.received_at);
    auto alarms = state.view(t0 + 61s)->alarms;
    REQUIRE(find(alarms, "boot"));
    CHECK(find(alarms, "boot")->text.find("boot 8, before 7") != std::string::npos);
}

TEST_CASE("console: a late packet of the life before is no new boot") {
    console_state state;
    talker before, now;
    now.boot = 8;
    auto late = before.say(at(28.1, -15.4), t0, link_id::iridium);
    state.on_telemetry(xbee_path, now.say(at(28.2, -15.4), t0 + 60s), t0 + 60s);
    state.on_telemetry(iridium_path, late, t0 + 90s);
    state.on_telemetry(xbee_path, now.say(at(28.2, -15.4), t0 + 91s), t0 + 91s);
    CHECK_FALSE(find(state.view(t0 + 92s)->alarms, "boot"));
}

TEST_CASE("console: a lost proxy, its port, its heat and its duty cycle call the operator") {
    console_state state;
    state.on_link(xbee_path, true, "", t0);
    state.on_time(t0);
    CHECK(state.view(t0)->alarms.empty());
    xbee_local local;
    local.trouble = "/dev/ttyUSB0: no such device";
    local.temperature_c = std::int16_t{63};
    local.duty_cycle_percent = std::uint8_t{95};
    state.on_xbee(xbee_path, local, t0 + 1s);
    state.on_time(t0 + 1s);
    auto alarms = state.view(t0 + 1s)->alarms;
    CHECK(find(alarms, "port:" + xbee_path)->text.find("ttyUSB0") != std::string::npos);
    CHECK(find(alarms, "hot:" + xbee_path));
    CHECK(find(alarms, "duty:" + xbee_path));
    state.on_link(xbee_path, false, "its proxy is not reached", t0 + 2s);
    state.on_time(t0 + 3s);
    CHECK_FALSE(find(state.view(t0 + 3s)->alarms, "proxy:" + xbee_path));
    state.on_time(t0 + 8s);
    CHECK(find(state.view(t0 + 8s)->alarms, "proxy:" + xbee_path));
    state.on_link(xbee_path, true, "", t0 + 9s);
    state.on_time(t0 + 9s);
    CHECK(find(state.view(t0 + 9s)->alarms, "proxy:" + xbee_path)->over_at);
}

TEST_CASE(
    "console: packets of a link that cannot be kept call the operator, a boat that does not call there does not") {
    console_state state;
    state.on_link(gprs_path, true, "", t0);
    gprs_state result;
    result.trouble = "the boat has not called yet";
    state.on_gprs(gprs_path, result, t0);
    state.on_time(t0);
    CHECK_FALSE(find(state.view(t0)->alarms, "port:" + gprs_path));
    result.connected = true;
    result.trouble = "telemetry cannot be kept: the disk is full";
    state.on_gprs(gprs_path, result, t0 + 1s);
    state.on_time(t0 + 1s);
    auto alarms = state.view(t0 + 1s)->alarms;
    REQUIRE(find(alarms, "port:" + gprs_path));
    CHECK(find(alarms, "port:" + gprs_path)->text.find("disk is full") != std::string::npos);
    CHECK(state.view(t0 + 1s)->links[0].told_at == t0 + 1s);
}

TEST_CASE("console: a budget that runs low is a notice, a spent one a warning that says what it means") {
    console_state state;
    state.on_link(gprs_path, true, "", t0);
    state.on_link(iridium_path, true, "", t0);
    gprs_state gprs;
    gprs.budget = budget_after(1000, 500, 10'000, 500);
    state.on_gprs(gprs_path, gprs, t0);
    iridium_account account;
    account.daily_budget = 50;
    account.budget_left = 6;
    state.on_account(iridium_path, account, t0);
    state.on_time(t0);
    CHECK_FALSE(find(state.view(t0)->alarms, "budget:" + gprs_path));
    CHECK_FALSE(find(state.view(t0)->alarms, "budget:" + iridium_path));
    gprs.budget = budget_after(1000, 900, 10'000, 900);
    state.on_gprs(gprs_path, gprs, t0);
    account.budget_left = 0;
    state.on_account(iridium_path, account, t0);
    state.on_time(t0);
    auto alarms = state.view(t0)->alarms;
    REQUIRE(find(alarms, "budget:" + gprs_path));
    CHECK(find(alarms, "budget:" + gprs_path)->how == severity::notice);
    CHECK(find(alarms, "budget:" + gprs_path)->text ==
          "GPRS: 10 % of today's budget and 91 % of this month's are left");
    REQUIRE(find(alarms, "budget:" + iridium_path));
    CHECK(find(alarms, "budget:" + iridium_path)->how == severity::warning);
    CHECK(find(alarms, "budget:" + iridium_path)->text ==
          "Iridium: today's budget is spent: it goes on at 00:00 UTC; telecommands over it wait");
    gprs.budget = budget_after(1000, 1000, 10'000, 1000);
    gprs.budget_notice = "today's budget is spent";
    state.on_gprs(gprs_path, gprs, t0);
    state.on_time(t0);
    CHECK(find(state.view(t0)->alarms, "budget:" + gprs_path)->how == severity::warning);
    CHECK(find(state.view(t0)->alarms, "budget:" + gprs_path)->text == "GPRS: today's budget is spent");
}

TEST_CASE("console: a link that falls silent while the other goes on calls the operator") {
    console_state state;
    talker boat;
    state.on_telemetry(xbee_path, boat.say(at(28.1, -15.4), t0), t0);
    for (int i = 1; i < 20; ++i)
        state.on_telemetry(gprs_path, boat.say(at(28.1, -15.4), t0 + i * 10s, link_id::gprs), t0 + i * 10s);
    state.on_time(t0 + 190s);
    auto alarms = state.view(t0 + 190s)->alarms;
    CHECK(find(alarms, "silent:" + xbee_path));
    CHECK_FALSE(find(alarms, "silent:" + gprs_path));
    CHECK_FALSE(find(alarms, "no_data"));
}

} // namespace alarms_test
