#include <components/coast/sea_limits.hpp>

#include <support/catch.hpp>

#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <random>

namespace limits_test {

using namespace atirma;

namespace {

constexpr std::string_view square = R"({"type":"Polygon","coordinates":[[[10,50],[10.01,50],[10.01,50.01],[10,50.01],
    [10,50]]]})";

geofence fence(std::string_view text) { return geofence::parse(text, "fence.geojson").value(); }

bool says(const std::optional<std::string>& trouble, const char* part) {
    return trouble && trouble->find(part) != std::string::npos;
}

/// By looking at every ten metres of it: another way than the crossing of edges.
bool touches_land(const sea_limits& limits, coast_point a, coast_point b) {
    int steps = static_cast<int>(flat_distance_m(a, b) / 10) + 1;
    for (int i = 0; i <= steps; ++i) {
        double part = static_cast<double>(i) / steps;
        if (limits.on_land({a.latitude_deg + part * (b.latitude_deg - a.latitude_deg),
                            a.longitude_deg + part * (b.longitude_deg - a.longitude_deg)}))
            return true;
    }
    return false;
}

} // namespace

TEST_CASE("sea limits: the courses of the bay are in the water, and La Isleta is land") {
    auto sea = sea_limits::coast_only();
    CHECK(sea->on_land({28.1640, -15.4245}));
    CHECK(sea->on_land({27.97, -15.60}));
    CHECK_FALSE(sea->on_land({28.1530, -15.4480}));
    coast_point t1[] = {{28.1530, -15.4480}, {28.1600, -15.4520}, {28.1545, -15.4580}};
    coast_point t2[] = {{28.1600, -15.4600}, {28.1680, -15.4560}, {28.1640, -15.4690}};
    for (auto* course : {t1, t2})
        for (int i = 0; i < 3; ++i) {
            CHECK_FALSE(sea->trouble(course[i], course[(i + 1) % 3]));
            CHECK(sea->clearance_m(course[i], 2000) > 200);
        }
    CHECK(says(sea->trouble({28.1530, -15.4480}, {28.1640, -15.4245}), "ends on land"));
    CHECK(says(sea->trouble({28.1530, -15.4480}, {28.1600, -15.3900}), "crosses land after"));
    CHECK(says(sea->trouble({28.1640, -15.4245}, {28.1530, -15.4480}), "starts on land"));
    CHECK(sea->trouble(coast_point{28.1640, -15.4245}) == "is on land");
    CHECK(sea->trouble({28.1530, -15.4480}, {40.0, -40.0}) == std::nullopt);
}

TEST_CASE("sea limits: of 200 random legs around the island, those over land are all found, and only those") {
    auto sea = sea_limits::coast_only();
    std::mt19937 random(20261125);
    std::uniform_real_distribution<double> latitude(27.65, 28.25), longitude(-15.90, -15.30);
    int over_land = 0, missed = 0, wrong = 0;
    for (int i = 0; i < 200; ++i) {
        coast_point a{latitude(random), longitude(random)}, b{latitude(random), longitude(random)};
        bool touches = touches_land(*sea, a, b), found = sea->trouble(a, b).has_value();
        over_land += touches;
        missed += touches && !found;
        // Between two samples a leg may cut a corner of less than ten metres.
        wrong += found && !touches;
        if (found && !touches) {
            auto at = sea->metres_to_land(a, b);
            REQUIRE(at);
            double part = *at / flat_distance_m(a, b);
            coast_point place{a.latitude_deg + part * (b.latitude_deg - a.latitude_deg),
                              a.longitude_deg + part * (b.longitude_deg - a.longitude_deg)};
            CHECK(std::abs(sea->clearance_m(place, 100)) < 1);
        }
    }
    CHECK(over_land > 20);
    CHECK(missed == 0);
    CHECK(wrong < 10);
}

TEST_CASE("sea limits: the distance to land is where the leg meets it") {
    auto sea = sea_limits::coast_only();
    coast_point from{28.1530, -15.4480};
    auto there = sea->metres_to_land(from, flat_destination(from, 90, 20'000));
    REQUIRE(there);
    CHECK_FALSE(sea->on_land(flat_destination(from, 90, *there - 2)));
    CHECK(sea->on_land(flat_destination(from, 90, *there + 2)));
    CHECK(sea->metres_to_land({28.1640, -15.4245}, from) == 0.0);
    CHECK_FALSE(sea->metres_to_land(from, flat_destination(from, 300, 20'000)));
}

TEST_CASE("sea limits: a fence keeps in, its holes and other areas keep out") {
    sea_limits in(fence(square), false);
    CHECK(in.within_fence({50.005, 10.005}));
    CHECK_FALSE(in.within_fence({50.005, 10.02}));
    CHECK(says(in.trouble({50.005, 10.005}, {50.005, 10.02}), "ends outside the fence"));
    CHECK_FALSE(in.trouble({50.002, 10.002}, {50.008, 10.008}));
    CHECK_FALSE(in.trouble({50.005, 10.02}, {50.005, 10.005})); // back into it
    double clear = in.fence_clearance_m({50.005, 10.001}, 5000);
    CHECK(clear == Approx(71.5).margin(1));
    CHECK(in.fence_clearance_m({50.005, 10.011}, 5000) == Approx(-71.5).margin(1));

    sea_limits bent(fence(R"({"type":"FeatureCollection","features":[
        {"type":"Feature","properties":{"name":"bay"},"geometry":{"type":"Polygon","coordinates":[[[10,50],[10.02,50],
         [10.02,50.02],[10,50.02],[10,50]]]}},
        {"type":"Feature","properties":{"fence":"keep-out","name":"reef"},"geometry":{"type":"MultiPolygon",
         "coordinates":[[[[10.009,50.005],[10.011,50.005],[10.011,50.015],[10.009,50.015],[10.009,50.005]]]]}}]})"),
                    false);
    CHECK(bent.fence().areas().size() == 2);
    CHECK(bent.fence().areas()[1].keep_out);
    CHECK_FALSE(bent.within_fence({50.01, 10.01}));
    CHECK(says(bent.trouble({50.01, 10.002}, {50.01, 10.018}), "leaves the fence after 500 m"));
    CHECK_FALSE(bent.trouble({50.001, 10.002}, {50.001, 10.018}));
    CHECK(bent.trouble(coast_point{50.01, 10.01}) == "is outside the fence");
}

TEST_CASE("sea limits: two areas that overlap are one") {
    sea_limits in(
        fence(R"({"type":"MultiPolygon","coordinates":[[[[10,50],[10.01,50],[10.01,50.01],[10,50.01],[10,50]]],
        [[[10.008,50],[10.02,50],[10.02,50.01],[10.008,50.01],[10.008,50]]]]})"),
        false);
    CHECK_FALSE(in.trouble({50.005, 10.001}, {50.005, 10.019}));
}

TEST_CASE("sea limits: edges inside of what the fence allows are no limits") {
    sea_limits in(
        fence(R"({"type":"MultiPolygon","coordinates":[[[[10,50],[10.01,50],[10.01,50.01],[10,50.01],[10,50]]],
        [[[10.008,49.995],[10.02,49.995],[10.02,50.005],[10.008,50.005],[10.008,49.995]]],
        [[[10.02,49.995],[10.03,49.995],[10.03,50.005],[10.02,50.005],[10.02,49.995]]]]})"),
        false);
    double metres_east = flat_distance_m({50, 10}, {50, 10.001});
    CHECK(in.fence_clearance_m({50.004, 10.009}, 5000) == Approx(std::hypot(metres_east, 111.2)).margin(1));
    CHECK(in.fence_clearance_m({50.0025, 10.0079}, 5000) == Approx(278).margin(1));              // of the first's south
    CHECK(in.fence_clearance_m({50, 10.02}, 5000) == Approx(556).margin(1));                     // on a common edge
    CHECK(in.fence_clearance_m({50.004, 10.02}, 5000) == Approx(111.2).margin(1));               // at its end
    CHECK(in.fence_clearance_m({50.0075, 10.0105}, 5000) == Approx(-metres_east / 2).margin(1)); // outside
    CHECK_FALSE(in.trouble({50.0025, 10.005}, {50.0025, 10.025}));

    // An area to keep out that lies half outside: only its edges within count, and what it cuts off does not.
    sea_limits bent(fence(R"({"type":"FeatureCollection","features":[
        {"type":"Feature","geometry":{"type":"Polygon","coordinates":[[[10,50],[10.02,50],[10.02,50.02],[10,50.02],
         [10,50]]]}},
        {"type":"Feature","properties":{"fence":"keep-out"},"geometry":{"type":"Polygon","coordinates":[[[10.005,49.99],
         [10.015,49.99],[10.015,50.01],[10.005,50.01],[10.005,49.99]]]}}]})"),
                    false);
    CHECK(bent.fence_clearance_m({50.012, 10.01}, 5000) == Approx(222.4).margin(1));
    CHECK(bent.fence_clearance_m({50.001, 10.01}, 5000) == Approx(-5 * metres_east).margin(1));
    CHECK(bent.fence_clearance_m({50.005, 10.002}, 5000) == Approx(2 * metres_east).margin(1));
}

TEST_CASE("sea limits: a leg through as many adjoining areas as a fence can have is judged at once") {
    std::string text = R"({"type":"MultiPolygon","coordinates":[)";
    constexpr int squares = 1990;
    for (int i = 0; i < squares; ++i) {
        double west = 10 + 0.001 * i, east = 10 + 0.001 * (i + 1);
        text += fmt::format("{}[[[{:.3f},50],[{:.3f},50],[{:.3f},50.01],[{:.3f},50.01],[{:.3f},50]]]", i ? "," : "",
                            west, east, east, west, west);
    }
    auto squares_of = fence(text + "]}");
    const auto start = std::chrono::steady_clock::now();
    sea_limits in(squares_of, false);
    for (int leg = 0; leg < 40; ++leg) CHECK_FALSE(in.trouble({50.005, 10.0005}, {50.005, 11.9895}));
    CHECK(says(in.trouble({50.005, 10.0005}, {50.009, 11.9905}), "ends outside the fence"));
    CHECK(in.fence_clearance_m({50.004, 11.0005}, 5000) == Approx(444.8).margin(1));
    CHECK(std::chrono::steady_clock::now() - start < std::chrono::seconds(10)); // a hundred times what it takes
}

TEST_CASE("sea limits: a fence over the antimeridian is one area") {
    sea_limits in(fence(R"({"type":"Polygon","coordinates":[[[179.99,0],[-179.99,0],[-179.99,0.02],[179.99,0.02],
        [179.99,0]]]})"),
                  false);
    CHECK(in.within_fence({0.01, 180}));
    CHECK(in.within_fence({0.01, -179.995}));
    CHECK_FALSE(in.within_fence({0.01, 0}));
    CHECK_FALSE(in.trouble({0.01, 179.995}, {0.01, -179.995}));
    CHECK(in.trouble({0.01, 179.995}, {0.01, -179.98}));
}

TEST_CASE("geofence: what is not a fence is refused, with its place") {
    auto why = [](std::string_view text) {
        auto read = geofence::parse(text, "my.geojson");
        REQUIRE_FALSE(read);
        return read.error().message();
    };
    auto has = [&](std::string_view text, const char* part) {
        INFO(text);
        auto message = why(text);
        CAPTURE(message);
        CHECK(message.find("my.geojson") != std::string::npos);
        CHECK(message.find(part) != std::string::npos);
    };
    has("no json", "not JSON");
    has("[]", "not a GeoJSON object");
    has(R"({"type":"Point","coordinates":[1,2]})", "neither a Polygon nor a MultiPolygon");
    has(R"({"type":"FeatureCollection","features":[]})", "no area");
    has(R"({"type":"FeatureCollection","features":[{"type":"Feature","geometry":null}]})", "feature 1");
    has(R"({"type":"Polygon","coordinates":[[[0,0],[1,0],[1,1]]]})", "fewer than four");
    has(R"({"type":"Polygon","coordinates":[[[0,0],[1,0],[1,1],[0,1]]]})", "not its first");
    has(R"({"type":"Polygon","coordinates":[[[0,0],[1,0],[1,91],[0,0]]]})", "latitude 91");
    has(R"({"type":"Polygon","coordinates":[[[0,0],["x",0],[1,1],[0,0]]]})", "[longitude, latitude]");
    has(R"({"type":"Feature","properties":{"fence":"out"},"geometry":{"type":"Polygon","coordinates":[]}})",
        "keep-out");
    std::string many = R"({"type":"Polygon","coordinates":[[[0,0])";
    for (int i = 0; i < 10'001; ++i) many += ",[0,1]";
    has(many + "]]}", "more than 10000");
    CHECK(geofence::parse(std::string(geofence::max_bytes + 1, ' '), "my.geojson").error().code() ==
          ise::errc::too_large);
}

} // namespace limits_test
