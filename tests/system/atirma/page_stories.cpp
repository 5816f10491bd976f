#include "sea.hpp"

#include <components/web_server/telemetry_feed.hpp>

#include <support/catch.hpp>

using namespace std::chrono_literals;

TEST_CASE("atirma: the page shows the boat where it is, its course and its mode") {
    sea it;
    auto& page = it.start_page();
    REQUIRE(it.until([&] { return page.state().track().size() >= 5; }));
    auto shown = *page.state().position();
    auto truth = it.boat().location_now();
    CHECK(shown.latitude_deg == Approx(truth.latitude_deg).margin(2e-4));
    CHECK(shown.longitude_deg == Approx(truth.longitude_deg).margin(2e-4));
    auto result =
        page.state()
            .snapshot(std::chrono::floor<std::chrono::milliseconds>(it.world.wall_start + it.world.elapsed()), {})
            .data;
    CHECK(result.find("automatic") != std::string::npos);
    CHECK(result.find("\"xbee\"") != std::string::npos);
    CHECK(page.statistics().by_type.contains("waypoints"));
    CHECK(page.events_published() > 0);
}

TEST_CASE("atirma: the page says that its proxy is gone, and goes on when that is back") {
    sea it;
    auto& page = it.start_page();
    REQUIRE(it.until([&] { return page.statistics().received >= 5; }));
    auto now = [&] { return std::chrono::floor<std::chrono::milliseconds>(it.world.wall_start + it.world.elapsed()); };
    auto connected = [&] {
        return page.state().snapshot(now(), {}).data.find("\"connected\":true") != std::string::npos;
    };
    CHECK(connected());
    it.proxy_process().crash();
    REQUIRE(it.until([&] { return !connected(); }));
    it.proxy_process().restart();
    REQUIRE(it.until(connected));
    auto packets = page.statistics().received;
    REQUIRE(it.until([&] { return page.statistics().received > packets; }));
}

TEST_CASE("atirma: ten times the speed sails ten times as far, and telemetry is dated by the clock") {
    sea slow(5, 1), fast(5, 10);
    auto& seen = fast.watch();
    slow.world.run_for(2min);
    fast.world.run_for(2min);
    CHECK(fast.boat().location_now().distance_sailed_m > 5 * slow.boat().location_now().distance_sailed_m);
    REQUIRE_FALSE(seen.telemetry.empty());
    const auto& last = seen.telemetry.back();
    CHECK(last.measured_at <= last.received_at);
    CHECK(last.received_at - last.measured_at < 30s);
}

TEST_CASE("atirma: the wind can be changed while the boat sails") {
    sea it;
    std::optional<atirma::scene> result;
    it.user([&result](ise::component& self) -> ise::task<> {
        atirma::scene_request request;
        request.wind_speed_mps = 11;
        request.wind_from_deg = 200;
        auto boat = sea::boat_of(self);
        result = co_await boat.call(atirma::services::scene_control, request, 5s);
    });
    REQUIRE(it.until([&] { return result.has_value(); }));
    CHECK_FALSE(result->original_wind);
    it.world.run_for(2s);
    CHECK(it.boat().wind_now().true_speed_mps == Approx(11));
    CHECK(it.boat().wind_now().true_direction_deg == Approx(200));
}

TEST_CASE(
    "atirma: the scene gives the helm to the remote control, the boat refuses what steers, until it is released") {
    sea it;
    auto scene_with = [&](atirma::scene_request request) {
        std::optional<ise::result<atirma::scene>> result;
        it.user([&result, request](ise::component& self) -> ise::task<> {
            auto boat = sea::boat_of(self);
            result = co_await boat.try_call(atirma::services::scene_control, request, 5s);
        });
        REQUIRE(it.until([&] { return result.has_value(); }));
        return *result;
    };
    auto mode = [&](std::uint32_t id) {
        atirma::telecommand_request request;
        request.id = id;
        request.command = atirma::commands::set_mode{atirma::sailing_mode::hold};
        std::optional<ise::result<atirma::telecommand_reply>> answer;
        it.user([&answer, request](ise::component& self) -> ise::task<> {
            auto shore = sea::proxy(self);
            answer = co_await shore.try_call(atirma::services::telecommand, request, 20s);
        });
        REQUIRE(it.until([&] { return answer.has_value(); }));
        REQUIRE(*answer);
        return **answer;
    };
    atirma::scene_request rudder_alone;
    rudder_alone.rudder_deg = 10;
    auto no = scene_with(rudder_alone);
    REQUIRE_FALSE(no);
    CHECK(no.error().message().find("give remote_control true") != std::string::npos);
    auto helm = rudder_alone;
    helm.remote_control = true;
    helm.rudder_deg = 46;
    CHECK(scene_with(helm).error().message().ends_with("rudder_deg is -45 to 45, not 46"));
    helm.rudder_deg = -10;
    auto taken = scene_with(helm);
    REQUIRE(taken);
    CHECK(taken->remote_control);
    CHECK(taken->rudder_deg == -10);
    CHECK(it.boat().navigation_now().remote_control);
    auto refused = mode(1);
    CHECK(refused.result == atirma::ack_code::refused);
    CHECK(refused.text == "the remote control has the helm until it is released");
    atirma::scene_request release;
    release.remote_control = false;
    CHECK_FALSE(scene_with(release)->remote_control);
    CHECK(mode(2).result == atirma::ack_code::done);
}

TEST_CASE(
    "atirma: the page tells a position of the second controller from others, and the remote control from a mode") {
    atirma::track_state page;
    atirma::telemetry_feed feed(page);
    const atirma::utc_time start(1'700'000'000'000ms);
    auto hear = [&](std::uint16_t boot, atirma::utc_time at, const atirma::telemetry_body& body) {
        atirma::telemetry_packet packet;
        packet.link = atirma::link_id::iridium;
        packet.boot = boot;
        packet.sequence = static_cast<std::uint32_t>(at.time_since_epoch().count());
        packet.measured_at = at;
        packet.received_at = at + 1s;
        packet.raw = atirma::encode_telemetry({boot, packet.sequence, at}, body);
        feed.take(packet, at + 1s);
    };
    atirma::location fix;
    fix.quality = atirma::fix_quality::gps;
    fix.latitude_deg = 28.15;
    fix.longitude_deg = -15.45;
    hear(7, start, fix);
    REQUIRE(page.position());
    CHECK(page.position()->from.source == "iridium");
    hear(atirma::beacon_boot, start + 60s, fix);
    CHECK(page.position()->from.source == "beacon");
    hear(8, start + 120s, fix);
    CHECK(page.position()->from.source == "iridium");
    atirma::navigation sails;
    sails.remote_control = true;
    hear(8, start + 121s, sails);
    CHECK(page.snapshot(start + 122s).data.find("\"remote_control\"") != std::string::npos);
    sails.remote_control = false;
    hear(8, start + 123s, sails);
    CHECK(page.snapshot(start + 124s).data.find("\"remote_control\"") == std::string::npos);
}
