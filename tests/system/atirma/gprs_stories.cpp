#include "gprs_sea.hpp"

#include <support/catch.hpp>

#include <set>

using namespace std::chrono_literals;
using namespace atirma;

namespace {

carrier_request up(bool how) {
    carrier_request made;
    made.up = how;
    return made;
}

/// No packet twice, and of each type only the newest as news; packets of one instant are equally new.
void check_order(const gprs_sea::watched_link& seen) {
    std::map<std::pair<int, std::string>, utc_time> newest;
    std::set<std::pair<int, std::uint32_t>> numbers;
    for (const auto& packet : seen.telemetry) {
        REQUIRE(numbers.emplace(packet.boot, packet.sequence).second);
        REQUIRE(packet.link == link_id::gprs);
        if (packet.history) continue;
        auto message = parse_telemetry(packet.raw);
        REQUIRE(message);
        auto& last = newest[{packet.boot, std::string(name_of(message->body))}];
        REQUIRE(packet.measured_at >= last);
        last = packet.measured_at;
    }
    CHECK(seen.again == 0);
    CHECK(seen.lost == 0);
}

std::size_t late(const gprs_sea::watched_link& seen) {
    return static_cast<std::size_t>(
        std::count_if(seen.telemetry.begin(), seen.telemetry.end(), [](const auto& packet) { return packet.history; }));
}

} // namespace

TEST_CASE("atirma gprs: telemetry comes by both links, each packet says by which, and the page shows the newest") {
    for (const auto* protocol : {"tcp", "udp"}) {
        gprs_sea it(protocol);
        auto& page = it.start_page_of_both();
        auto& seen = it.watch_gprs();
        INFO(protocol);
        REQUIRE(it.until([&] { return seen.telemetry.size() >= 30 && page.state().track().size() >= 10; }));
        REQUIRE(it.until([&] { return it.whole(); }));
        check_order(seen);
        if (std::string(protocol) == "tcp") CHECK(late(seen) == 0); // datagrams overtake each other
        std::set<std::string> types;
        for (const auto& packet : seen.telemetry) types.insert(std::string(name_of(parse_telemetry(packet.raw)->body)));
        for (const auto* type : {"location", "navigation", "wind"}) CHECK(types.contains(type));
        auto now = std::chrono::floor<std::chrono::milliseconds>(it.world.wall_start + it.world.elapsed());
        auto result = page.state().snapshot(now, {}).data;
        CHECK(result.find("\"xbee\"") != std::string::npos);
        CHECK(result.find("\"gprs\"") != std::string::npos);
    }
}

TEST_CASE("atirma gprs: each link can be off while the page goes on with the other, and says where the fix came from") {
    gprs_sea it;
    auto& page = it.start_page_of_both();
    REQUIRE(it.until([&] { return page.state().track().size() >= 5; }));
    auto fix_by = [&](const std::string& link) {
        return it.until([&] { return page.state().position() && page.state().position()->from.source == link; }) &&
               page.state().position()->from.measured_at + 15s >
                   std::chrono::floor<std::chrono::milliseconds>(it.world.wall_start + it.world.elapsed());
    };
    it.radio(false);
    CHECK(fix_by("gprs"));
    it.world.run_for(1min);
    CHECK(fix_by("gprs"));
    it.radio(true);
    it.carrier_does(up(false));
    it.world.run_for(1min);
    CHECK(fix_by("xbee"));
    it.carrier_does(up(true));
    CHECK(fix_by("gprs"));
}

TEST_CASE("atirma gprs: minutes without the carrier lose nothing: what was measured meanwhile comes as history") {
    for (const auto* protocol : {"tcp", "udp"}) {
        gprs_sea it(protocol);
        auto& seen = it.watch_gprs();
        REQUIRE(it.until([&] { return seen.telemetry.size() >= 10; }));
        carrier_request outage;
        outage.outage_s = 240;
        it.carrier_does(outage);
        it.world.run_for(230s);
        CHECK(seen.truth->gprs_waiting > 80);
        INFO(protocol);
        REQUIRE(it.until([&] { return it.whole(); }, 10min));
        check_order(seen);
        CHECK(late(seen) > 60);
    }
}

TEST_CASE("atirma gprs: a carrier that drops, goes deaf, changes addresses and delays by seconds loses nothing") {
    for (const auto* protocol : {"tcp", "udp"}) {
        gprs_sea it(protocol, 11);
        auto& seen = it.watch_gprs();
        REQUIRE(it.until([&] { return seen.telemetry.size() >= 10; }));
        carrier_request slow, drop, deaf, move;
        slow.delay_s = 4;
        slow.jitter_s = 3;
        slow.loss = 0.1;
        drop.drop = true;
        deaf.half_open = true;
        move.change_address = true;
        it.carrier_does(slow);
        it.world.run_for(40s);
        for (const auto& what : {drop, deaf, move, deaf, drop, move}) {
            it.carrier_does(what);
            it.world.run_for(70s);
        }
        carrier_request good;
        good.delay_s = 0.2;
        good.jitter_s = 0.1;
        good.loss = 0;
        it.carrier_does(good);
        INFO(protocol);
        REQUIRE(it.until([&] { return it.whole(); }, 20min));
        check_order(seen);
        CHECK(seen.state->given_up == 0);
    }
}

TEST_CASE("atirma gprs: a telecommand that takes both links is done once, and answered on each") {
    gprs_sea it;
    auto& seen = it.watch_gprs();
    REQUIRE(it.until([&] { return !seen.telemetry.empty(); }));
    telecommand_request add;
    add.id = 77;
    add.command = commands::waypoint_add{{28.15, -15.46}};
    auto before = it.boat().pilot().list().size();
    gprs_sea::asked by_gprs, by_radio;
    it.command(add, 60s, by_gprs, true);
    it.command(add, 60s, by_radio, false);
    REQUIRE(it.until([&] { return by_gprs && by_radio; }));
    for (const auto* answer : {&by_gprs, &by_radio}) {
        REQUIRE(**answer);
        CHECK((**answer)->state == telecommand_stage::acknowledged);
        CHECK((**answer)->value == static_cast<float>(before + 1));
    }
    CHECK(it.boat().pilot().list().size() == before + 1);
}

TEST_CASE("atirma gprs: telecommands wait for the carrier, survive its delay, and set the period of their link") {
    gprs_sea it;
    auto& seen = it.watch_gprs();
    REQUIRE(it.until([&] { return !seen.telemetry.empty(); }));
    it.carrier_does(up(false));
    it.world.run_for(30s);
    gprs_sea::asked pending, slow, period;
    it.command(set_mode(5, sailing_mode::hold), 5s, pending);
    REQUIRE(it.until([&] { return pending.has_value(); }));
    REQUIRE(*pending);
    CHECK((*pending)->state == telecommand_stage::pending);
    it.carrier_does(up(true));
    REQUIRE(it.until(
        [&] { return !seen.states.empty() && seen.states.back().state == telecommand_stage::acknowledged; }, 5min));
    CHECK(it.boat().pilot().mode() == sailing_mode::hold);
    carrier_request late;
    late.delay_s = 5;
    it.carrier_does(late);
    it.command(set_mode(6, sailing_mode::station_keep), 2min, slow);
    REQUIRE(it.until([&] { return slow.has_value(); }, 5min));
    CHECK((*slow)->state == telecommand_stage::acknowledged);
    CHECK((*slow)->text == "station_keep");
    telecommand_request often;
    often.id = 8;
    often.command = commands::set_telemetry_period{link_id::gprs, 1};
    it.command(often, 2min, period);
    REQUIRE(it.until([&] { return period.has_value(); }, 5min));
    CHECK((*period)->value == 1);
    CHECK(it.boat().telemetry_period_s(link_id::gprs) == 1);
}

TEST_CASE(
    "atirma gprs: a boat that reboots on command has lost nothing of before, and one that was killed starts afresh") {
    gprs_sea it;
    auto& seen = it.watch_gprs();
    REQUIRE(it.until([&] { return seen.telemetry.size() >= 10; }));
    it.carrier_does(up(false));
    it.world.run_for(40s);
    it.carrier_does(up(true));
    telecommand_request reboot;
    reboot.id = 9;
    reboot.command = commands::reboot();
    gprs_sea::asked answer;
    it.command(reboot, 2min, answer);
    REQUIRE(it.until([&] { return answer.has_value(); }, 5min));
    CHECK((*answer)->state == telecommand_stage::acknowledged);
    REQUIRE(it.until([&] {
        return std::any_of(seen.telemetry.begin(), seen.telemetry.end(),
                           [](const auto& packet) { return packet.boot == 101; });
    }));
    REQUIRE(it.until([&] { return it.whole(); }));
    check_order(seen);
    it.boat_options.boot = 200;
    it.boat_process().restart();
    REQUIRE(it.until([&] {
        return std::any_of(seen.telemetry.begin(), seen.telemetry.end(),
                           [](const auto& packet) { return packet.boot == 200 && !packet.history; });
    }));
}

TEST_CASE("atirma gprs: the proxy is killed and started again while the boat sails: everything that the boat sent is "
          "acknowledged") {
    gprs_sea it;
    auto& seen = it.watch_gprs();
    REQUIRE(it.until([&] { return seen.telemetry.size() >= 20; }));
    it.gprs_process().crash();
    it.world.run_for(45s);
    it.gprs_process().restart();
    REQUIRE(it.until([&] { return seen.state && seen.state->logins > 0 && seen.truth->gprs_waiting == 0; }));
    CHECK(seen.state->given_up == 0);
    CHECK(seen.truth->gprs_dropped == 0);
    for (std::size_t i = 1; i < seen.telemetry.size(); ++i)
        CHECK(seen.telemetry[i].received_at >= seen.telemetry[i - 1].received_at);
}

TEST_CASE("atirma gprs: a carrier refuses what makes no sense, and changes nothing") {
    gprs_sea it;
    std::vector<std::string> refusals;
    std::optional<carrier_state> after;
    it.user([&](ise::component& self) -> ise::task<> {
        auto between = gprs_sea::carrier(self);
        std::vector<carrier_request> bad(3);
        bad[0].loss = 1.5;
        bad[1].delay_s = -1;
        bad[2].outage_s = 1e9;
        for (auto& request : bad) {
            request.up = false;
            auto response = co_await between.try_call(services::carrier_control, request, 5s);
            if (!response && response.error().code() == ise::errc::refused)
                refusals.push_back(response.error().message());
        }
        carrier_request nothing;
        auto response = co_await between.try_call(services::carrier_control, nothing, 5s);
        after = response.value();
    });
    REQUIRE(it.until([&] { return after.has_value(); }));
    CHECK(refusals.size() == 3);
    CHECK(after->up);
    CHECK(after->loss == 0);
    CHECK(after->listening.size() == 2);
}
