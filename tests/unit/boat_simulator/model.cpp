#include <components/boat_simulator/line_follower.hpp>
#include <components/boat_simulator/wind_source.hpp>

#include <support/catch.hpp>
#include <support/shared_data.hpp>

#include <fstream>
#include <iterator>

namespace model_test {

using namespace atirma::simulator;

namespace {
double settled_speed(double wind_mps, double angle_off_wind_deg) {
    boat_state state;
    wind_vector wind{wind_mps, pi - radians(angle_off_wind_deg)};
    follower_settings settings;
    for (int i = 0; i < 3000; ++i)
        state = step(state, steer_to(0, state, wind, settings), wind, small_boat_parameters(), 0.1);
    return state.speed_mps;
}
std::string refusal(std::string_view csv) {
    auto parsed = parse_wind_csv(csv, "wind.csv");
    REQUIRE_FALSE(parsed);
    return parsed.error().message();
}
} // namespace

TEST_CASE("on a broad reach the small boat makes the stated speeds") {
    CHECK(settled_speed(3, 150) == Approx(0.8).epsilon(0.05));
    CHECK(settled_speed(6, 150) == Approx(1.15).epsilon(0.05));
    CHECK(settled_speed(10, 150) == Approx(1.5).epsilon(0.05));
    CHECK(settled_speed(14, 150) == Approx(1.8).epsilon(0.05));
}

TEST_CASE("a boat at rest head to wind never moves through the water") {
    boat_state state;
    wind_vector wind{8, pi}; // heading east, blowing towards west
    actuators set{0.3, 0.3};
    for (int i = 0; i < 6000; ++i) state = step(state, set, wind, small_boat_parameters(), 0.1);
    CHECK(std::abs(state.speed_mps) < 1e-6);
    CHECK(state.position_m.x < 0); // only drifts
}

TEST_CASE("the boat heels to leeward and comes upright without wind") {
    boat_state state;
    wind_vector from_port{8, -pi / 2};
    actuators set{0, 0.6};
    for (int i = 0; i < 200; ++i) state = step(state, set, from_port, small_boat_parameters(), 0.1);
    CHECK(degrees(state.heel_rad) > 1);
    CHECK(degrees(state.heel_rad) < 45);
    for (int i = 0; i < 2000; ++i) state = step(state, set, {}, small_boat_parameters(), 0.1);
    CHECK(degrees(state.heel_rad) == Approx(0).margin(0.1));
}

TEST_CASE("smaller steps do not change where the boat gets") {
    boat_state coarse, fine;
    wind_vector wind{7, -pi / 2};
    actuators set{0.1, 0.7};
    for (int i = 0; i < 600; ++i) coarse = step(coarse, set, wind, small_boat_parameters(), 0.1);
    for (int i = 0; i < 6000; ++i) fine = step(fine, set, wind, small_boat_parameters(), 0.01);
    CHECK(length(coarse.position_m - fine.position_m) < 0.5);
}

TEST_CASE("the published parameters make a much faster boat") {
    boat_state state;
    for (int i = 0; i < 6000; ++i) state = step(state, {0, 0.8}, {6, -pi / 2}, published_parameters(), 0.05);
    CHECK(state.speed_mps > 3);
}

TEST_CASE("the line follower beats upwind inside its corridor and never points into the forbidden angle") {
    follower_settings settings;
    follower_state memory;
    boat_state state;
    state.heading_rad = pi / 2;
    wind_vector wind{6, pi}; // the line goes east, straight into it
    int tacks = 0;
    double side = memory.side;
    for (int i = 0; i < 36000; ++i) {
        auto s = follow_line({0, 0}, {1e5, 0}, state, wind, settings, 0, memory, 0.1);
        CHECK(std::abs(wrap_rad(s.course_rad)) >= settings.forbidden_upwind_rad - 1e-9);
        if (memory.side != side) ++tacks, side = memory.side;
        state = step(state, s.set, wind, small_boat_parameters(), 0.1);
        if (std::abs(state.position_m.y) > settings.corridor_m) FAIL("left the corridor");
    }
    CHECK(state.position_m.x > 400);
    CHECK(tacks > 10);
}

TEST_CASE("metres and the chart lead to each other") {
    local_chart chart({28.155, -15.453});
    CHECK(length(chart.to_metres({28.155, -15.453})) == 0);
    vec north = chart.to_metres({28.165, -15.453});
    CHECK(north.y == Approx(1112).margin(2));
    auto back = chart.to_waypoint({1234, -567});
    CHECK(length(chart.to_metres(back) - vec{1234, -567}) < 1e-6);
    CHECK(compass_deg(0) == Approx(90));
    CHECK(compass_deg(from_compass_rad(271.5)) == Approx(271.5));
}

TEST_CASE("the chart goes on over the dateline") {
    local_chart chart({-16.8, 179.99});
    vec there = chart.to_metres({-16.8, -179.99});
    CHECK(there.x == Approx(2129).margin(5));
    CHECK(chart.to_waypoint(there).longitude_deg == Approx(-179.99).margin(1e-9));
    local_chart from_the_west({-16.8, -179.99});
    vec back = from_the_west.to_metres({-16.8, 179.99});
    CHECK(back.x == Approx(-2129).margin(5));
    CHECK(from_the_west.to_waypoint(back).longitude_deg == Approx(179.99).margin(1e-9));
}

TEST_CASE("gusting wind is the same for a seed, differs for another, and keeps its mean") {
    auto a = gusting_wind({6, 30}, 7), b = gusting_wind({6, 30}, 7), c = gusting_wind({6, 30}, 8);
    double sum = 0, least = 99, most = 0;
    bool differs = false;
    for (int t = 0; t < 20000; ++t) {
        auto w = a->at(t);
        CHECK(w.speed_mps == b->at(t).speed_mps);
        differs |= w.speed_mps != c->at(t).speed_mps;
        sum += w.speed_mps;
        least = std::min(least, w.speed_mps);
        most = std::max(most, w.speed_mps);
    }
    CHECK(differs);
    CHECK(sum / 20000 == Approx(6).epsilon(0.05));
    CHECK(most > 7.5);
    CHECK(least < 4.5);
}

TEST_CASE("a recorded wind is interpolated, by the shorter way round, and starts again at its end") {
    auto series = parse_wind_csv("t_s,tws_mps,twd_deg\n10,4,350\n20,8,10\n30,8,20\n", "wind.csv");
    REQUIRE(series);
    CHECK((*series)->at(0).from_deg == Approx(350));
    CHECK((*series)->at(2.5).from_deg == Approx(355));
    CHECK((*series)->at(7.5).from_deg == Approx(5));
    CHECK((*series)->at(5).speed_mps == Approx(6));
    CHECK((*series)->at(20 + 5).speed_mps == Approx(6));
    CHECK((*series)->at(2000 + 15).from_deg == Approx(15));
    auto knots = parse_wind_csv("t_s,utc,tws_vwt_kn,twd_est_deg\r\n0,0,10,90\r\n2,0,,\r\n4,0,10,90\r\n", "w");
    REQUIRE(knots);
    CHECK((*knots)->size() == 2);
    CHECK((*knots)->at(1).speed_mps == Approx(5.1444).epsilon(1e-4));
}

TEST_CASE("a wrong wind file is refused with its name and line") {
    CHECK(refusal("") == "wind.csv: no header line");
    CHECK(refusal("a,b\n") == "wind.csv:1: the header names no column t_s (seconds)");
    CHECK(refusal("t_s,twd_deg\n") == "wind.csv:1: the header names no wind speed: tws_mps, tws_kn or tws_vwt_kn");
    CHECK(refusal("t_s,tws_mps,twd_deg\n0,5,90\n1,five,90\n") == "wind.csv:3: wind speed \"five\" is not a number");
    CHECK(refusal("t_s,tws_mps,twd_deg\n0,5,90\n1,5\n") == "wind.csv:3: 2 columns, 3 are needed");
    CHECK(refusal("t_s,tws_mps,twd_deg\n1,5,90\n1,5,90\n") == "wind.csv:3: time 1 does not follow 1");
    CHECK(refusal("t_s,tws_mps,twd_deg\n0,nan,90\n") == "wind.csv:2: wind speed \"nan\" is not a number");
    CHECK(refusal("t_s,tws_mps,twd_deg\n0,,90\n") == "wind.csv: no row has both wind speed and direction");
}

TEST_CASE("the recorded series of a yacht can be sailed on") {
    auto file = ise_test::shared_data("plaka_2s.csv");
    if (!file) {
        WARN("plaka_2s.csv is not there (ISE_SHARED_DATA): not tried");
        return;
    }
    std::ifstream in(*file, std::ios::binary);
    std::string csv((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
    auto series = parse_wind_csv(csv, file->filename().string());
    REQUIRE(series);
    CHECK((*series)->size() > 7000);
    CHECK((*series)->length_s() == Approx(14845));
    CHECK((*series)->at(0).speed_mps == Approx(8.1 * 1852 / 3600).epsilon(1e-3));
    CHECK((*series)->at(0).from_deg == Approx(185.4));
}

} // namespace model_test
