#include <components/web_server/boat_source.hpp>
#include <components/web_server/downloads.hpp>
#include <components/web_server/track_export.hpp>
#include <components/web_server/web_component.hpp>

#include <ise/core/error.hpp>

#include <unit/http/client.hpp>

#include <support/catch.hpp>

#include <nlohmann/json.hpp>

#include <sstream>

namespace downloads_test {

using namespace std::chrono_literals;
using namespace atirma;
using ise_test::Contains;
using nlohmann::json;
using web_test::client;

namespace {

const utc_ms start{std::chrono::milliseconds(1'790'000'000'000)};

position_update fix(std::chrono::milliseconds after, double latitude, double longitude) {
    return {.from = {start + after, start + after, "xbee", false},
            .latitude_deg = latitude,
            .longitude_deg = longitude,
            .speed_over_ground_mps = 1.5};
}

/// Two fixes, twenty silent minutes, one more, and a rough one; a boat and a waypoint with names that hurt.
track_state voyage(std::string boat = "A<b>&\"c\"") {
    track_options options;
    options.boat = std::move(boat);
    track_state state(options);
    waypoints_update course;
    course.from = {start, start, "xbee", false};
    course.points = {{28.16, -15.452, "<script>"}};
    state.apply(course, start);
    state.apply(fix(0s, 28.0, -15.0), start);
    state.apply(fix(10s, 28.01, -15.0), start);
    state.apply(fix(20min, 28.1, -15.0), start + 20min);
    auto rough = fix(21min, 28.3, -15.2);
    rough.from.source = "iridium";
    rough.circular_error_m = 4000;
    state.apply(rough, start + 21min);
    return state;
}

struct site : web_test::grounds {
    explicit site(track_archive* archive = nullptr) : server(host->loop(), log, page_limits(), spawner()) {
        offer_downloads(server, "/vela", state, archive, [this] { return now; });
        server.listen(web_test::any_port()).value();
    }
    std::string get(std::string_view path) {
        client one(context, server.where().port);
        one.get(path);
        return one.read_answer();
    }
    track_state state = voyage();
    utc_ms now = start;
    ise::http_server server;
};

} // namespace

TEST_CASE("the track is offered as GPX and KML with escaped names") {
    auto state = voyage();
    auto gpx = to_gpx(state.options().boat, state.track(), state.waypoints(), state.sources(), state.rhythm());
    CHECK(gpx.find("<name>A&lt;b&gt;&amp;&quot;c&quot;</name>") != std::string::npos);
    CHECK(gpx.find("<script>") == std::string::npos);
    CHECK(gpx.find("<trkpt lat=\"28.0000000\" lon=\"-15.0000000\"><time>2026-09-21T14:13:20Z</time>") !=
          std::string::npos);
    CHECK(gpx.find("</trkseg>\n<trkseg>") != std::string::npos); // nothing was heard for twenty minutes
    CHECK(gpx.find("28.3") == std::string::npos);                // rough fixes are no part of a line
    auto kml = to_kml(state.options().boat, state.track(), state.waypoints());
    CHECK(kml.find("<gx:coord>-15.0000000 28.1000000 0</gx:coord>") != std::string::npos);
    CHECK(kml.find("Within about 4000 m") != std::string::npos);
    CHECK(to_gpx("", {}, {}, {}, {}).find("</gpx>") != std::string::npos);
}

TEST_CASE("a track over Iridium alone is one segment, and an outage ends it") {
    track_state state;
    for (auto after : {0min, 30min, 60min, 90min, 300min, 330min}) {
        auto one = fix(after, 28.0 + 0.001 * static_cast<double>(after.count()), -15.0);
        one.from.source = "iridium";
        state.on_report(link_id::iridium, start + after);
        state.apply(one, start + after);
    }
    auto gpx = to_gpx("x", state.track(), {}, state.sources(), state.rhythm());
    std::size_t segments = 0;
    for (auto at = gpx.find("<trkseg>"); at != std::string::npos; at = gpx.find("<trkseg>", at + 1)) ++segments;
    CHECK(segments == 2);
    auto lines = json::parse(to_geojson("x", state.track(), {}, state.sources(), state.rhythm()));
    auto drawn = lines["features"][0]["geometry"]["coordinates"];
    REQUIRE(drawn.size() == 2);
    CHECK(drawn[0].size() == 4);
}

TEST_CASE("the track as CSV has a header and what is known of each fix") {
    auto state = voyage();
    std::istringstream lines(to_csv(state.track(), state.sources()));
    std::string header, first, row, last;
    std::getline(lines, header);
    std::getline(lines, first);
    CHECK(header == "time_utc,latitude_deg,longitude_deg,speed_mps,course_deg,heading_deg,heel_deg,wind_speed_mps,wind_"
                    "direction_deg,circular_error_m,link\r");
    CHECK(first == "2026-09-21T14:13:20Z,28.0000000,-15.0000000,1.50,,,,,,,xbee\r");
    int rows = 1;
    while (std::getline(lines, row)) last = row, ++rows;
    CHECK(rows == 4);
    CHECK(last.find("4000.00,iridium") != std::string::npos);
}

TEST_CASE("the track as GeoJSON has a line for each time that the boat was heard, and times beside it") {
    auto state = voyage();
    auto parsed = json::parse(
        to_geojson(state.options().boat, state.track(), state.waypoints(), state.sources(), state.rhythm()));
    CHECK(parsed["type"] == "FeatureCollection");
    const auto& track = parsed["features"][0];
    CHECK(track["properties"]["name"] == "A<b>&\"c\"");
    REQUIRE(track["geometry"]["coordinates"].size() == 2);
    CHECK(track["geometry"]["coordinates"][0][1] == json::array({-15.0, 28.01}));
    for (const auto& line : track["geometry"]["coordinates"]) CHECK(line.size() >= 2); // RFC 7946, 3.1.4
    CHECK(track["properties"]["coordTimes"][0][1] == "2026-09-21T14:13:30Z");
    CHECK(parsed["features"][1]["properties"]["circular_error_m"] == 4000);
    CHECK(parsed["features"][2]["properties"]["name"] == "<script>");
    CHECK(json::parse(to_geojson("", {}, {}, {}, {}))["features"][0]["geometry"]["coordinates"].empty());
}

TEST_CASE("a download covers the time that was asked for, and a bad time is refused with how it is written") {
    site s;
    CHECK_THAT(s.get("/vela/track.csv"), Contains("28.1000000") && Contains("filename=\"a-tirma.csv\""));
    auto part = s.get("/vela/track.csv?from=2026-09-21T14:13:25Z&until=2026-09-21%2014:20");
    CHECK_THAT(part, Contains("28.0100000") && !Contains("28.0000000,") && !Contains("28.1000000"));
    auto bad = s.get("/vela/track.gpx?from=yesterday");
    CHECK_THAT(bad, Contains("HTTP/1.1 400") && Contains("2026-11-21T10:00:00Z"));
    CHECK_THAT(s.get("/vela/telemetry.ndjson"), Contains("HTTP/1.1 404")); // nothing is kept
}

TEST_CASE("a download is made once in ten seconds") {
    site s;
    auto first = s.get("/vela/track.csv");
    s.state.apply(fix(30min, 28.2, -15.0), start + 30min);
    s.now += 9s;
    CHECK(s.get("/vela/track.csv").find("28.2000000") == std::string::npos);
    s.now += 2s;
    CHECK(s.get("/vela/track.csv").find("28.2000000") != std::string::npos);
}

TEST_CASE("after a slow download from an archive those of all boats rest, under each of their addresses") {
    archive_options options;
    options.file = "memory:downloads-rest";
    auto archive = track_archive::open(options).value();
    for (const auto* boat : {"a-tirma", "nao"}) REQUIRE(archive->enter(boat, boat));
    auto first = voyage(), second = voyage("Nao");
    auto now = start;
    auto step = 300ms;
    auto slow = [&] { return now += step; }; // from one look at the clock to the next
    web_test::grounds here;
    ise::http_server server(here.host->loop(), here.log, page_limits(), here.spawner());
    offer_downloads(server, "", first, archive.get(), slow);
    offer_downloads(server, "/vela", first, archive.get(), slow);
    offer_downloads(server, "/nao", second, archive.get(), slow);
    server.listen(web_test::any_port()).value();
    auto get = [&](std::string_view path) {
        client one(here.context, server.where().port);
        one.get(path);
        return one.read_answer();
    };
    CHECK_THAT(get("/track.csv"), Contains("HTTP/1.1 200"));
    step = 1ms;
    for (const auto* path : {"/track.gpx", "/vela/track.csv", "/nao/track.csv"}) {
        CAPTURE(path);
        CHECK_THAT(get(path), Contains("HTTP/1.1 503"));
    }
    now += 10s;
    CHECK_THAT(get("/nao/track.csv"), Contains("HTTP/1.1 200"));
}

TEST_CASE("downloads from an archive have what is kept there, and what is not there yet") {
    archive_options options;
    options.file = "memory:downloads";
    auto archive = track_archive::open(options).value();
    REQUIRE(archive->enter("a-tirma", "A-Tirma"));
    track_point old;
    old.at = start - 48h;
    old.latitude_deg = 27.5;
    archive->keep("a-tirma", old, "gprs");
    telemetry_packet packet;
    packet.boot = 2;
    packet.sequence = 8;
    packet.measured_at = packet.received_at = start;
    packet.raw = encode_telemetry({2, 8, start}, notice{"hello"});
    archive->keep("a-tirma", packet, "notice");
    REQUIRE(archive->commit(start));
    site s(archive.get());
    auto csv = s.get("/vela/track.csv");
    CHECK_THAT(csv, Contains("27.5000000") && Contains(",gprs\r") && Contains("28.1000000"));
    auto lines = s.get("/vela/telemetry.ndjson");
    auto parsed = json::parse(lines.substr(lines.find("\r\n\r\n") + 4));
    CHECK(parsed["kind"] == "notice");
    CHECK(parsed["packet"]["text"] == "hello");
    CHECK(parsed["measured_at"] == "2026-09-21T14:13:20Z");
}

TEST_CASE("times are read as people and programs write them") {
    auto at = [](std::string_view text) { return parse_time(text).value_or(utc_ms(-1ms)); };
    CHECK(at("1790000000000") == start);
    CHECK(at("2026-09-21T14:13:20Z") == start);
    CHECK(at("2026-09-21T14:13:20.250Z") == start + 250ms);
    CHECK(at("2026-09-21 14:13") == start - 20s);
    CHECK(at("2026-09-21") == std::chrono::floor<std::chrono::days>(start));
    for (auto bad : {"", "now", "2026-02-30", "2026-09-21T24:00", "2026-09-21T14:13:20+02:00", "-5",
                     "99999999999999999999", "2026-9-21"})
        CHECK_FALSE(parse_time(bad));
    CHECK(query_value("a=1&from=2%3A3+4&b", "from") == "2:3 4");
    CHECK(query_value("xfrom=1&from", "from").empty());
    CHECK(query_value("from=%", "from") == "%");
}

TEST_CASE("boats are told as NAME=PATH and have an address each") {
    auto boat = parse_boat(" Vela II = vela/shore/xbee, vela/shore/gprs");
    CHECK(boat.name == "Vela II");
    CHECK(boat.telemetry == std::vector<std::string>{"vela/shore/xbee", "vela/shore/gprs"});
    for (auto bad : {"", "Vela", "=vela/x", "Vela=", "Vela= ,"})
        CHECK_THROWS_WITH(parse_boat(bad), Contains("NAME=PATH"));
    CHECK(address_of("Vela II") == "vela-ii");
    CHECK(address_of("  --") == "");

    std::vector<boat_source> two = {{"A-Tirma", "", {"a"}}, boat};
    name_boats(two);
    CHECK(two[1].id == "vela-ii");
    two.push_back({"VELA ii", "", {"b"}});
    CHECK_THROWS_WITH(name_boats(two), Contains("same address") && Contains("/vela-ii"));
    std::vector<boat_source> reserved = {{"Embed", "", {"a"}}}, nameless = {{"\xe8\x88\xb9", "", {"a"}}};
    CHECK_THROWS_WITH(name_boats(reserved), Contains("a part of the page"));
    CHECK_THROWS_WITH(name_boats(nameless), Contains("letters a-z"));
}

} // namespace downloads_test
