#include "sea.hpp"

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
