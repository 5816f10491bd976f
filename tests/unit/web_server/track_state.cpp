#include <components/web_server/track_state.hpp>

#include <support/catch.hpp>

#include <nlohmann/json.hpp>

#include <cmath>
#include <limits>

namespace track_state_test {

using namespace std::chrono_literals;
using nlohmann::json;

namespace {
const atirma::utc_ms start{std::chrono::milliseconds(1'790'000'000'000)};

atirma::position_update fix(std::chrono::milliseconds after, double latitude, double longitude, bool history = false) {
    return {.from = {start + after, start + after, "xbee", history},
            .latitude_deg = latitude,
            .longitude_deg = longitude,
            .speed_over_ground_mps = 1.5,
            .course_over_ground_deg = 0.0};
}

bool near(double value, double wanted, double margin) { return std::abs(value - wanted) <= margin; }

json parsed(const std::optional<ise::sse_event>& event) {
    REQUIRE(event.has_value());
    return json::parse(event->data);
}
} // namespace

TEST_CASE("the newest fix wins and history fills the track without moving the boat backwards") {
    atirma::track_state state;
    state.apply(fix(0s, 28.0, -15.0), start);
    state.apply(fix(100s, 28.1, -15.0), start + 100s);

    auto late = parsed(state.apply(fix(50s, 28.05, -15.0, true), start + 101s));
    CHECK_FALSE(late["state"].contains("position"));
    CHECK(late["points"].size() == 1);
    CHECK(state.position()->latitude_deg == 28.1);
    REQUIRE(state.track().size() == 3);
    CHECK(state.track()[1].latitude_deg == 28.05);
    CHECK(state.statistics().out_of_order == 1);

    // History that is newer than anything known is the newest all the same.
    auto newer = parsed(state.apply(fix(150s, 28.2, -15.0, true), start + 160s));
    CHECK(newer["state"]["position"]["latitude_deg"] == 28.2);
}

TEST_CASE("a fix that two links bring is one point of the track") {
    atirma::track_state state;
    state.apply(fix(0s, 28.0, -15.0), start);
    auto again = fix(0s, 28.0, -15.0);
    again.from.source = "gprs";
    again.from.received_at = start + 3s;
    CHECK_FALSE(state.apply(again, start + 3s).has_value());
    CHECK(state.track().size() == 1);
}

TEST_CASE("reports that cannot be are refused, and single values that cannot be are left out") {
    atirma::track_state state;
    auto nan = std::numeric_limits<double>::quiet_NaN();
    CHECK_FALSE(state.apply(fix(0s, 91, 0), start).has_value());
    CHECK_FALSE(state.apply(fix(0s, 0, nan), start).has_value());
    CHECK_FALSE(state.apply(fix(0s, 0, 180.5), start).has_value());
    auto ancient = fix(0s, 28, -15);
    ancient.from.measured_at = atirma::utc_ms{};
    CHECK_FALSE(state.apply(ancient, start).has_value());
    CHECK(state.statistics().refused == 4);
    CHECK(state.track().empty());

    auto odd = fix(0s, 28, -15);
    odd.speed_over_ground_mps = 5000;
    odd.course_over_ground_deg = -90;
    auto event = parsed(state.apply(odd, start));
    CHECK(event["state"]["position"]["speed_over_ground_mps"].is_null());
    CHECK(event["state"]["position"]["course_over_ground_deg"] == 270.0);
}

TEST_CASE("a boat whose clock is in the future does not block the fixes that follow") {
    atirma::track_state state;
    auto wrong = fix(0s, 28, -15);
    wrong.from.measured_at = start + 24h;
    state.apply(wrong, start);
    CHECK(state.statistics().clock_corrected == 1);
    auto right = parsed(state.apply(fix(10s, 28.01, -15), start + 10s));
    CHECK(right["state"]["position"]["latitude_deg"] == 28.01);
}

TEST_CASE("distance counts the way sailed and not the noise of a boat at rest") {
    atirma::track_state state;
    for (int i = 0; i < 500; ++i) // a metre to and fro
        state.apply(fix(i * 2s, 28.0 + (i % 2) * 0.00001, -15.0), start + i * 2s);
    auto rest = json::parse(state.snapshot(start).data)["state"]["trip"];
    CHECK(rest["distance_m"].get<double>() < 5);
    CHECK(rest["started_at"] == start.time_since_epoch().count());

    state.apply(fix(1100s, 28.01, -15.0), start + 1100s);
    auto moved = json::parse(state.snapshot(start).data)["state"]["trip"];
    CHECK(near(moved["distance_m"].get<double>(), 1112, 3));
}

TEST_CASE("a detour that history brings is added to the way once") {
    atirma::track_state state;
    state.apply(fix(0s, 28.0, -15.0), start);
    state.apply(fix(200s, 28.02, -15.0), start + 200s);
    state.apply(fix(100s, 28.01, -15.01, true), start + 210s);
    double leg = atirma::distance_m(28.0, -15.0, 28.01, -15.01);
    auto trip = json::parse(state.snapshot(start).data)["state"]["trip"];
    CHECK(near(trip["distance_m"].get<double>(), 2 * leg, 1));
}

TEST_CASE("a long track stays bounded, keeps its ends, its length and its turns") {
    atirma::track_options options;
    options.track.max_points = 400;
    atirma::track_state state(options);
    const int legs = 10, fixes = 500;
    double sailed = 0, north_m = 0, east_m = 0;
    for (int i = 0; i < legs * fixes; ++i) { // north and east in turn, 3 m a fix
        if (i) (i / fixes % 2 ? east_m : north_m) += 3, sailed += 3;
        state.apply(fix(i * 2s, 28.0 + north_m / 111195, -15.0 + east_m / 111195 / 0.8829), start + i * 2s);
    }
    const auto& track = state.track();
    CHECK(track.size() <= 400);
    CHECK(track.front().at == start);
    CHECK(track.back().at == start + (legs * fixes - 1) * 2s);
    auto trip = json::parse(state.snapshot(start).data)["state"]["trip"];
    CHECK(near(trip["distance_m"].get<double>(), sailed, 0.01 * (sailed)));
    double drawn = 0;
    for (std::size_t i = 1; i < track.size(); ++i)
        drawn += atirma::distance_m(track[i - 1].latitude_deg, track[i - 1].longitude_deg, track[i].latitude_deg,
                                    track[i].longitude_deg);
    CHECK(near(drawn, sailed, 0.01 * (sailed))); // the corners are still there
    for (std::size_t i = 1; i < track.size(); ++i) CHECK(track[i - 1].at < track[i].at);
}

TEST_CASE("the next waypoint has a distance, a bearing and the time of arrival that the speed made good gives") {
    atirma::track_state state;
    state.apply(fix(0s, 28.0, -15.0), start);
    state.apply(
        atirma::waypoints_update{{start, start, "xbee", false}, {{28.1, -15.0, "north"}, {28.0, -15.1, ""}}, 0, false},
        start);
    std::optional<ise::sse_event> last;
    for (int i = 1; i <= 200; ++i) // 2 m/s towards it
        last = state.apply(fix(i * 2s, 28.0 + i * 4 / 111195.0, -15.0), start + i * 2s);
    auto next = parsed(last)["state"]["next"];
    CHECK(next["name"] == "north");
    CHECK(next["count"] == 2);
    CHECK(near(next["bearing_deg"].get<double>(), 0, 0.1));
    CHECK(near(next["closing_mps"].get<double>(), 2, 0.02 * (2)));
    double left_s = next["distance_m"].get<double>() / 2;
    CHECK(near(next["eta"].get<double>() - static_cast<double>((start + 400s).time_since_epoch().count()),
               left_s * 1000, 0.02 * (left_s * 1000)));

    auto turned = parsed(state.apply(
        atirma::navigation_update{.from = {start + 401s, start + 401s, "xbee", false}, .active_waypoint = 1},
        start + 401s));
    CHECK(turned["state"]["waypoints"]["active"] == 1);
    CHECK(turned["state"]["next"]["index"] == 1);
}

TEST_CASE("a boat that does not get nearer has no time of arrival") {
    atirma::track_state state;
    state.apply(atirma::waypoints_update{{start, start, "xbee", false}, {{28.1, -15.0, ""}}, 0, false}, start);
    auto away = fix(1s, 28.0, -15.0);
    away.course_over_ground_deg = 180;
    auto next = parsed(state.apply(away, start + 1s))["state"]["next"];
    CHECK(next["eta"].is_null());
    CHECK(next["closing_mps"].get<double>() < 0);
}

TEST_CASE("a client that comes back gets the points it has not seen, one of another epoch gets all") {
    atirma::track_options options;
    options.epoch = "abc";
    atirma::track_state state(options);
    state.apply(fix(0s, 28.0, -15.0), start);
    auto seen = state.apply(fix(10s, 28.001, -15.0), start + 10s);
    state.apply(fix(20s, 28.002, -15.0), start + 20s);
    state.apply(fix(5s, 28.0005, -15.0, true), start + 21s); // history since then counts too

    auto part = json::parse(state.snapshot(start + 30s, seen->id).data);
    CHECK(part["partial"] == true);
    CHECK(part["points"].size() == 2);
    for (const char* strange : {"", "other:2", "abc:", "abc:999", "abc:1x", "abc:-1"}) {
        auto whole = json::parse(state.snapshot(start + 30s, strange).data);
        CHECK(whole["partial"] == false);
        CHECK(whole["points"].size() == 4);
    }
    CHECK(state.snapshot(start + 30s).id == "abc:4");
}

TEST_CASE("wind is kept beside the fix it was measured with, also when it comes late") {
    atirma::track_state state;
    state.apply(fix(0s, 28.0, -15.0), start);
    state.apply(fix(300s, 28.01, -15.0), start + 300s);
    auto late = parsed(state.apply(
        atirma::wind_update{{start + 2s, start + 310s, "gprs", true}, std::nullopt, std::nullopt, 30.0, 7.0},
        start + 310s));
    CHECK(late["points"][0][0] == start.time_since_epoch().count());
    CHECK(state.track()[0].wind_speed_mps == 7.0);
    CHECK_FALSE(state.track()[1].wind_speed_mps.has_value());

    auto port = parsed(state.apply(
        atirma::wind_update{{start + 320s, start + 320s, "xbee", false}, 315.0, 8.0, 20.0, 7.0}, start + 320s));
    CHECK(port["state"]["wind"]["apparent_angle_deg"] == -45.0);
}

TEST_CASE("a receiver that is lost is told with its reason") {
    atirma::track_state state;
    auto lost = parsed(state.apply(atirma::feed_update{"xbee", false, start, "no answer"}, start));
    REQUIRE(lost["state"]["feeds"].is_array());
    CHECK(lost["state"]["feeds"][0]["connected"] == false);
    CHECK(lost["state"]["feeds"][0]["detail"] == "no answer");
    auto status = json::parse(state.status(start + 1s).data);
    CHECK(status["now"] == (start + 1s).time_since_epoch().count());
    CHECK(status["state"]["feeds"].size() == 1);
}

TEST_CASE("hostile texts and numbers of reports stay bounded and harmless") {
    atirma::track_state state;
    atirma::mode_update mode{{start, start, "xbee", false}, std::string(100000, 'x') + "\xff\n"};
    CHECK(parsed(state.apply(mode, start))["state"]["mode"]["mode"].get<std::string>().size() <= 64);
    atirma::mode_update binary{{start + 1s, start + 1s, "\xff\xfe", false}, "\xff"};
    CHECK(state.apply(binary, start + 1s).has_value()); // became text that a browser reads
    for (int i = 0; i < 1000; ++i) {
        auto stranger = fix(i * 2s, 28, -15);
        stranger.from.source = "link" + std::to_string(i);
        state.apply(stranger, start + i * 2s);
        state.apply(atirma::feed_update{stranger.from.source, true, start, ""}, start);
    }
    auto all = json::parse(state.snapshot(start).data)["state"];
    CHECK(all["sources"].size() <= 16);
    CHECK(all["heard"].size() <= 16);
    CHECK(all["feeds"].size() <= 16);
    atirma::waypoints_update many{
        {start, start, "xbee", false}, std::vector<atirma::track_waypoint>(501), std::nullopt, false};
    CHECK_FALSE(state.apply(many, start).has_value());
}

TEST_CASE("a rough fix is in the track, and the current position only where nothing better is fresh") {
    auto rough = [](std::chrono::milliseconds after) {
        auto made = fix(after, 28.5, -15.5);
        made.from.source = "iridium";
        made.circular_error_m = 4000;
        return made;
    };
    atirma::track_state state;
    state.apply(fix(0s, 28.0, -15.0), start);
    CHECK_FALSE(parsed(state.apply(rough(29s), start + 29s))["state"].contains("position"));
    CHECK(state.position()->latitude_deg == 28.0);
    CHECK(state.track().size() == 2);
    CHECK(parsed(state.apply(rough(5min), start + 5min))["state"].contains("position")); // the fix is stale
    CHECK(state.position()->circular_error_m == 4000);
    state.apply(fix(6min, 28.01, -15.0), start + 6min);
    CHECK(state.position()->latitude_deg == 28.01);
}

TEST_CASE(
    "the whole track is told column by column, in differences, and what is no position has a history of its own") {
    atirma::track_state state;
    auto second = fix(4s, 28.00001, -15.0);
    second.speed_over_ground_mps.reset();
    state.apply(fix(0s, 28.0, -15.0), start);
    state.apply(second, start + 4s);
    state.apply(fix(10min, 28.00003, -15.00002), start + 10min);
    for (int i = 0; i < 3; ++i) {
        auto at = start + i * 20s;
        state.apply(atirma::power_update{{at, at, "xbee", false}, 12.5 + i, {}, 80.0 - i}, at);
        state.apply(atirma::signal_update{{at, at, "gprs", false}, "xbee", -70.0 - i}, at);
    }
    auto parsed = json::parse(state.track_text());
    CHECK(parsed["id"] == state.id());
    auto& columns = parsed["columns"];
    CHECK(columns["at"] == json::parse("[1,[1790000000000,4000,596000]]"));
    CHECK(columns["latitude_deg"] == json::parse("[1000000,[28000000,10,20]]"));
    CHECK(columns["longitude_deg"] == json::parse("[1000000,[-15000000,0,-20]]"));
    CHECK(columns["speed_mps"] == json::parse("[100,[150,null,0]]"));
    CHECK(columns["heel_deg"] == json::parse("[1,[null,null,null]]"));
    CHECK(columns["silence_s"] == json::parse("[1,[0,4,592]]"));
    CHECK(parsed["histories"]["battery_charge_percent"]["value"] == json::parse("[100,[8000,-100,-100]]"));
    CHECK(parsed["histories"]["signal_xbee"]["at"] == json::parse("[1,[1790000000000,20000,20000]]"));
    // The newest reports come without it, and say where the stream goes on.
    auto newest = json::parse(state.newest_text(start + 10min, parsed["id"].get<std::string>(), R"("more":1,)"));
    CHECK(newest["id"] == parsed["id"]);
    CHECK(newest["more"] == 1);
    CHECK(newest["state"]["position"]["latitude_deg"] == 28.00003);
    CHECK(newest["state"]["signal"]["xbee"]["rssi_dbm"] == -72);
    CHECK_FALSE(newest.contains("points"));
}

TEST_CASE("an outage stays one when the track is thinned, and a late fix ends it") {
    atirma::track_line line({.max_points = 40});
    auto put = [&](std::chrono::seconds after) {
        atirma::track_point point;
        point.at = start + after;
        point.latitude_deg = 28 + 1e-5 * static_cast<double>(after.count());
        line.insert(point);
    };
    for (int i = 0; i < 15; ++i) put(i * 10s);
    for (int i = 0; i < 200; ++i) put(2h + i * 10s);
    CHECK(line.points().size() <= 40);
    int outages = 0;
    for (const auto& point : line.points()) outages += point.silence > 10s;
    CHECK(outages == 1);
    atirma::track_line short_line;
    atirma::track_point point;
    for (auto after : {0s, 600s, 300s}) {
        point.at = start + after;
        short_line.insert(point);
    }
    CHECK(short_line.points()[1].silence == 300s);
    CHECK(short_line.points()[2].silence == 300s);
}

TEST_CASE("how a link is doing is told once, and when it was heard last with it") {
    atirma::track_state state;
    atirma::feed_update result{"gprs", true, start, "", true, start - 3s};
    CHECK(parsed(state.apply(result, start))["state"]["heard"]["gprs"] == (start - 3s).time_since_epoch().count());
    result.last_heard = start - 1s;
    result.since = start + 1s;
    CHECK_FALSE(state.apply(result, start)); // the next status tells it
    auto status = json::parse(state.status(start).data)["state"];
    CHECK(status["heard"]["gprs"] == (start - 1s).time_since_epoch().count());
    CHECK(status["feeds"][0]["since"] == start.time_since_epoch().count());
    result.connected = false;
    CHECK(state.apply(result, start));
    result.last_heard = start + 1h; // by a clock of the shore that is ahead
    CHECK_FALSE(state.apply(result, start));
    status = json::parse(state.status(start).data)["state"];
    CHECK(status["heard"]["gprs"] == start.time_since_epoch().count());
}

TEST_CASE("no link is shown as heard in the future, whether a packet or the archive has the time") {
    atirma::track_state state;
    state.restore_heard("gprs", start + 1h, start);
    atirma::position_update fix;
    fix.from = {start, start + 1h, "xbee", false};
    fix.latitude_deg = 28.1;
    fix.longitude_deg = -15.4;
    REQUIRE(state.apply(fix, start));
    auto heard = json::parse(state.status(start).data)["state"]["heard"];
    CHECK(heard["gprs"] == start.time_since_epoch().count());
    CHECK(heard["xbee"] == start.time_since_epoch().count());
}

} // namespace track_state_test
