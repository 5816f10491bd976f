// The second controller over its own modem: through the gateway and the proxy to who shows it.
#include "ocean.hpp"

#include <components/boat_simulator/services.hpp>
#include <components/iridium/bundle.hpp>
#include <components/iridium/rockblock.hpp>
#include <ise/http/stream_http_client.hpp>

#include <support/catch.hpp>

#include <random>

namespace beacon_test {

using namespace std::chrono_literals;
using namespace atirma;

namespace {

scene_request power(std::optional<bool> main, std::optional<bool> controller, std::optional<bool> beacon = {}) {
    scene_request request;
    request.main_power = main;
    request.main_controller = controller;
    request.beacon_power = beacon;
    return request;
}

std::size_t of_beacon(const ocean::watched& seen) {
    return static_cast<std::size_t>(std::ranges::count(seen.telemetry, beacon_boot, &telemetry_packet::boot));
}
std::size_t of_main(const ocean::watched& seen) { return seen.telemetry.size() - of_beacon(seen); }

template <class Body>
std::optional<Body> newest(const ocean::watched& seen) {
    std::optional<Body> found;
    for (const auto& packet : seen.telemetry) {
        if (packet.boot != beacon_boot) continue;
        auto message = parse_telemetry(packet.raw).value();
        if (const auto* body = std::get_if<Body>(&message.body)) found = *body;
    }
    return found;
}

// The boat has no modems: the test sends what the shore receives.
void begin_without_modems(ocean& it) {
    it.with_beacon();
    it.boat_options.iridium.port.device.clear();
    it.boat_options.beacon.device.clear();
    it.start();
}

/// What a modem of that IMEI posted through the gateway.
void post(ocean& it, const std::string& imei, std::uint16_t momsn, ise::bytes data,
          std::optional<iridium::estimate> where = std::nullopt) {
    iridium::mo_delivery made;
    made.message.where = where;
    made.message.imei = imei;
    made.message.momsn = momsn;
    made.message.session_time = std::chrono::sys_seconds(1'700'000'000s + std::chrono::seconds(momsn));
    made.message.data = std::move(data);
    std::optional<ise::result<ise::http_answer>> answer;
    it.user([body = iridium::encode_mo_form(made), &answer](ise::component& self) -> ise::task<> {
        ise::stream_http_client client(self.on());
        ise::http_exchange request;
        request.method = "POST";
        request.url = "http://shore:7480/rockblock/mo";
        request.body = body;
        answer = co_await client.exchange(std::move(request), 3s);
    });
    REQUIRE(it.until([&] { return answer.has_value(); }));
    REQUIRE(*answer);
}

} // namespace

TEST_CASE("beacon: when the main power fails the position comes from the second controller, with the cause") {
    ocean it;
    it.with_beacon();
    it.start();
    auto& seen = it.watch();
    REQUIRE(it.until([&] { return of_main(seen) >= 4; }, 2h));
    CHECK(of_beacon(seen) == 0);
    CHECK_FALSE(it.set_scene(power(false, {})).main_power);
    REQUIRE(it.until([&] { return newest<location>(seen).has_value(); }, 1h));
    auto truth = it.boat().location_now();
    CHECK(newest<location>(seen)->latitude_deg == Approx(truth.latitude_deg).margin(0.01));
    CHECK(newest<notice>(seen)->text.starts_with("beacon: main power lost; own battery"));
    it.world.run_for(20min);
    auto main_packets = of_main(seen);
    auto beacon_packets = of_beacon(seen);
    it.world.run_for(1h);
    CHECK(of_main(seen) == main_packets);
    CHECK(of_beacon(seen) > beacon_packets);
    REQUIRE(seen.account);
    CHECK(seen.account->beacon_session_at);
    CHECK(seen.account->trouble.empty());

    it.set_scene(power(true, {}));
    REQUIRE(it.until([&] { return of_main(seen) > main_packets + 2; }, 2h));
    CHECK(newest<notice>(seen)->text.find("the main controller is back") != std::string::npos);
    it.world.run_for(1h);
    beacon_packets = of_beacon(seen);
    it.world.run_for(1h);
    CHECK(of_beacon(seen) == beacon_packets);
}

TEST_CASE("beacon: a telecommand switches it on and off, and telecommands go to the main controller's modem only") {
    ocean it;
    it.with_beacon();
    it.start();
    auto& seen = it.watch();
    REQUIRE(it.until([&] { return of_main(seen) >= 2; }, 2h));
    auto tell = [&](std::uint32_t id, boat_command what) {
        telecommand_request request;
        request.id = id;
        request.command = what;
        request.valid_s = 20'000;
        ocean::asked answer;
        it.command(request, 2h, answer);
        REQUIRE(it.until([&] { return answer.has_value(); }, 2h));
        REQUIRE(*answer);
        CHECK((*answer)->state == telecommand_stage::acknowledged);
        return (*answer)->text;
    };
    CHECK(tell(1, commands::emergency_beacon{true}) == "beacon on");
    REQUIRE(it.until([&] { return newest<location>(seen).has_value(); }, 1h));
    CHECK(newest<notice>(seen)->text.starts_with("beacon: switched on by telecommand"));
    CHECK(tell(2, commands::emergency_beacon{false}) == "beacon off");
    it.world.run_for(30min);
    auto packets = of_beacon(seen);
    it.world.run_for(1h);
    CHECK(of_beacon(seen) == packets);
}

TEST_CASE("beacon: its modem may bring a position and its cause only, and the main one's may not pass for it") {
    ocean it;
    begin_without_modems(it);
    auto& seen = it.watch();
    it.world.run_for(2s);
    const utc_time at(1'700'000'000'000ms);
    location fix;
    fix.quality = fix_quality::gps;
    fix.latitude_deg = 28.15;
    fix.longitude_deg = -15.45;
    auto main_imei = it.proxy_options.imei, beacon_imei = it.proxy_options.beacon_imei;
    post(it, main_imei, 1, encode_telemetry({beacon_boot, 1, at}, fix));
    post(it, beacon_imei, 2, encode_telemetry({7, 2, at}, fix));
    post(it, beacon_imei, 3, encode_telemetry({beacon_boot, 3, at}, navigation()));
    it.world.run_for(10s);
    CHECK(seen.telemetry.empty());
    CHECK(seen.account->malformed == 3);
    post(it, beacon_imei, 4, encode_telemetry({beacon_boot, 4, at}, fix));
    post(it, main_imei, 5, encode_telemetry({7, 5, at}, fix));
    REQUIRE(it.until([&] { return seen.telemetry.size() == 2; }));
}

TEST_CASE("beacon: the estimated position is that of the newest session with one, of either modem, and has its time") {
    ocean it;
    begin_without_modems(it);
    auto& seen = it.watch();
    it.world.run_for(2s);
    auto main_imei = it.proxy_options.imei, beacon_imei = it.proxy_options.beacon_imei;
    auto session = [](std::uint16_t momsn) { return utc_time(1'700'000'000s + std::chrono::seconds(momsn)); };
    location fix;
    fix.quality = fix_quality::gps;
    std::uint32_t sequence = 0;
    auto arrives = [&](const std::string& imei, std::uint16_t momsn, std::optional<iridium::estimate> where) {
        auto boot = imei == beacon_imei ? beacon_boot : std::uint16_t{7};
        post(it, imei, momsn, encode_telemetry({boot, ++sequence, session(momsn)}, fix), where);
        it.world.run_for(10s);
        REQUIRE(seen.account);
        return *seen.account;
    };
    auto known = arrives(main_imei, 50, iridium::estimate{28.1, -15.4, 5});
    CHECK(known.estimate->latitude_deg == 28.1);
    CHECK(known.estimate_at == session(50));
    known = arrives(beacon_imei, 60, iridium::estimate{28.2, -15.5, 7});
    CHECK(known.estimate->latitude_deg == 28.2);
    CHECK(known.estimate_at == session(60));
    CHECK(known.last_session_at == session(50));
    CHECK(known.beacon_session_at == session(60));
    for (const auto& imei : {main_imei, beacon_imei}) // the gateway delivers an older session later
        known = arrives(imei, 40, iridium::estimate{27.9, -15.1, 3});
    CHECK(known.estimate->latitude_deg == 28.2);
    CHECK(known.estimate_cep_km == 7);
    CHECK(known.last_session_at == session(50));
    CHECK(known.beacon_session_at == session(60));
    known = arrives(main_imei, 70, std::nullopt);
    CHECK(known.last_session_at == session(70));
    CHECK(known.estimate_at == session(60));
}

TEST_CASE("beacon: over seeds of failures of main controller, its power, both and the beacon, one tells the position") {
    for (std::uint64_t seed = 1; seed <= 3; ++seed) {
        INFO("seed " << seed);
        std::mt19937_64 random(seed);
        ocean it(seed);
        it.with_beacon();
        it.gateway_options.session_failures = 0.2;
        it.gateway_options.duplicates = 0.3;
        it.start();
        auto& seen = it.watch();
        REQUIRE(it.until([&] { return of_main(seen) >= 2; }, 3h));
        bool main = true, controller = true, beacon = true;
        for (int step = 0; step < 4; ++step) {
            switch (random() % 4) {
                case 0: main = !main; break;
                case 1: controller = !controller; break;
                case 2: main = controller = !main; break;
                default: beacon = !beacon; break;
            }
            it.set_scene(power(main, controller, beacon));
            it.world.run_for(25min); // what was under way arrives
            auto main_packets = of_main(seen), beacon_packets = of_beacon(seen);
            it.world.run_for(30min);
            CHECK((of_main(seen) > main_packets) == (main && controller));
            CHECK((of_beacon(seen) > beacon_packets) == (beacon && !(main && controller)));
        }
    }
}

} // namespace beacon_test
