#include "examples.hpp"

#include <ise/packet/json.hpp>
#include <support/catch.hpp>

#include <limits>

namespace json_test {

using namespace example;
using ise_test::Contains;

namespace {
struct track {
    std::vector<waypoint> waypoints;
    mode helm = mode::autopilot;
    std::uint8_t count = 3;
    std::chrono::milliseconds period{250};
};

std::string message(std::string_view json) {
    return failure_of([&] { ise::from_json<track>(json); }).message();
}

struct oddities {
    float nan = 0;
    double inf = 0;
    std::uint64_t big = 0;
    std::int64_t low = 0;
    char text[6] = "abc";
    char letter = 'x';
    std::optional<std::optional<int>> twice;
    std::map<int, std::string> numbered;
    std::chrono::nanoseconds long_time{0};
    std::chrono::duration<std::int64_t, std::ratio<1, 3>> thirds{0};
    std::chrono::sys_time<std::chrono::nanoseconds> when{};
    std::chrono::sys_seconds far{};
    std::chrono::duration<double> no_time{0}, no_end{0};
    std::chrono::sys_time<std::chrono::duration<double, std::milli>> before_all{};
    std::string text_of_bytes;
};
} // namespace

TEST_CASE("a packet is shown as JSON that people can read") {
    track t;
    t.waypoints = {{"say \"hi\"\n", 28.15, -15.5}};
    CHECK(
        ise::to_json(t) ==
        R"({"waypoints":[{"name":"say \"hi\"\n","latitude_deg":28.15,"longitude_deg":-15.5}],"helm":"autopilot","count":3,"period":0.25})");
    CHECK(ise::to_json(t, ise::json_style::pretty) == "{\n"
                                                      "  \"waypoints\": [\n"
                                                      "    {\n"
                                                      "      \"name\": \"say \\\"hi\\\"\\n\",\n"
                                                      "      \"latitude_deg\": 28.15,\n"
                                                      "      \"longitude_deg\": -15.5\n"
                                                      "    }\n"
                                                      "  ],\n"
                                                      "  \"helm\": \"autopilot\",\n"
                                                      "  \"count\": 3,\n"
                                                      "  \"period\": 0.25\n"
                                                      "}");
}

TEST_CASE("every kind of field comes back from its JSON") {
    everything sent = filled();
    sent.names = {{2, "y"}, {513, "x"}};
    std::string json = ise::to_json(sent);
    auto got = ise::from_json<everything>(json);
    CHECK(ise::encode(got) == ise::encode(sent));
    CHECK_THAT(json, Contains(R"("raw":"Af8=")"));
    CHECK_THAT(json, Contains(R"("at":"2017-09-04T00:00:00.000001Z")"));
    CHECK_THAT(json, Contains(R"("choice":{"index":1,"value":"second"})"));
    CHECK_THAT(json, Contains(R"("parameters":{"gain":0.5,"trim":-1})"));
    CHECK(ise::to_json(ise::from_json<everything>(ise::to_json(sent, ise::json_style::pretty))) == json);
}

TEST_CASE("values at the edges come back exactly") {
    oddities o;
    o.nan = std::numeric_limits<float>::quiet_NaN();
    o.inf = -std::numeric_limits<double>::infinity();
    o.big = std::numeric_limits<std::uint64_t>::max();
    o.low = std::numeric_limits<std::int64_t>::min();
    o.letter = '\x01';
    o.no_time = decltype(o.no_time)(std::numeric_limits<double>::quiet_NaN());
    o.no_end = decltype(o.no_end)(std::numeric_limits<double>::infinity());
    o.before_all += decltype(o.no_end)(-std::numeric_limits<double>::infinity());
    o.twice = std::optional<int>();
    o.numbered = {{-1, "a"}};
    for (std::int64_t ticks : {std::numeric_limits<std::int64_t>::min(), std::int64_t{-1'500'000'001}, std::int64_t{7},
                               std::numeric_limits<std::int64_t>::max()}) {
        o.long_time = std::chrono::nanoseconds(ticks);
        o.thirds = decltype(o.thirds)(ticks);
        o.when = decltype(o.when)(std::chrono::nanoseconds(ticks));
        o.far = decltype(o.far)(std::chrono::seconds(ticks));
        INFO(ise::to_json(o));
        CHECK(ise::encode(ise::from_json<oddities>(ise::to_json(o))) == ise::encode(o));
    }
    o.text_of_bytes = "a\xff";
    CHECK_THAT(ise::to_json(o), Contains("\"a\xef\xbf\xbd\"")); // no JSON text can hold it
}

namespace {

struct edges {
    float largest = std::numeric_limits<float>::max(), smallest = -largest;
    double below_zero = -0.0;
    std::chrono::nanoseconds span{};
};

} // namespace

TEST_CASE("the largest floats, a negative zero and long times with all their digits come back exactly") {
    edges packet;
    for (std::int64_t from : {std::int64_t{1} << 51, std::int64_t{4'300'000'000'000'000}, std::int64_t{1} << 53})
        for (std::int64_t ticks = from - 500; ticks < from + 500; ++ticks) {
            packet.span = std::chrono::nanoseconds(ticks % 2 == 0 ? ticks : -ticks);
            const auto text = ise::to_json(packet);
            if (ise::encode(ise::from_json<edges>(text)) == ise::encode(packet)) continue;
            FAIL_CHECK(text);
            return;
        }
    CHECK_THROWS(ise::from_json<edges>(R"({"largest":3.4028236e+38})"));
}

TEST_CASE("fields that are missing take their defaults") {
    auto got = ise::from_json<track>(R"({"waypoints":[{"name":"a"}]})");
    CHECK(got.waypoints.at(0) == waypoint{"a", 0, 0});
    CHECK(got.helm == mode::autopilot);
    CHECK(got.period == std::chrono::milliseconds(250));
    CHECK(ise::from_json<position>("{}") == position{});
}

TEST_CASE("JSON that does not fit says where and what was expected") {
    CHECK(message(R"({"waypoints":[{},{},{},{"latitude_deg":"north"}]})") ==
          "waypoints[3].latitude_deg: expected a number, found \"north\"");
    CHECK(message(R"({"waypoint":[]})") == "waypoint: no such field, did you mean 'waypoints'?");
    CHECK(message(R"({"waypoints":[{"lat_deg":1}]})") ==
          "waypoints[0].lat_deg: no such field, did you mean 'latitude_deg'?");
    CHECK(message(R"({"count":256})") == "count: expected a number from 0 to 255 (u8), found 256");
    CHECK(message(R"({"count":-1})") == "count: expected a number from 0 to 255 (u8), found -1");
    CHECK(message(R"({"count":1.5})") == "count: expected a whole number, found 1.5");
    CHECK(message(R"({"count":1e300})") == "count: expected a number from 0 to 255 (u8), found 1e+300");
    CHECK(message(R"({"helm":"sleep"})") == "helm: expected one of idle, autopilot, manual, found \"sleep\"");
    CHECK(message("[]") == "track: expected an object, found a list");
    CHECK_THAT(message("{\"count\":"), Contains("track: no JSON: parse error at line 1"));
    CHECK(ise::from_json<track>(R"({"count":2.0,"helm":200,"period":"1.5s"})").period ==
          std::chrono::milliseconds(1500));
}

TEST_CASE("hostile JSON is bounded, and each limit is told by its name") {
    auto refusal = [](const std::string& json, ise::json_limits limits = {},
                      const ise::schema& of = ise::schema_of<track>()) {
        auto why = failure_of([&] { ise::from_json(of, json, limits); });
        CHECK(why.code() == ise::errc::too_large);
        return why.message();
    };
    CHECK_THAT(refusal(std::string(1000000, '[')), Contains("64 levels (max_depth)"));
    ise::json_limits tight;
    tight.max_text_bytes = 4;
    CHECK_THAT(refusal("{     }", tight), Contains("at most 4 are accepted (max_text_bytes)"));
    tight = {};
    tight.max_packet_bytes = 100;
    CHECK_THAT(refusal(R"({"waypoints":[{},{},{},{},{},{},{},{},{},{}]})", tight),
               Contains("beyond 100 bytes") && Contains("(max_packet_bytes)"));
    auto fat = ise::schema::parse("vector<struct{a:array<u8,200000000>}>");
    REQUIRE(fat.has_value());
    CHECK_THAT(refusal("[{},{},{}]", {}, *fat),
               Contains("beyond 268435456 bytes by its default values (max_packet_bytes)"));
}

TEST_CASE(
    "a packet whose JSON is longer than allowed is refused, and the field is named where it was (max_json_bytes)") {
    track sent;
    sent.waypoints.resize(1000);
    auto packet = ise::encode(sent);
    auto write = [&](std::size_t most) {
        return ise::to_json(ise::schema_of<track>(), packet, ise::json_style::compact, most);
    };
    auto whole = write(std::size_t{1} << 20);
    CHECK(write(whole.size()) == whole);
    auto why = failure_of([&] { write(1000); });
    CHECK(why.code() == ise::errc::too_large);
    CHECK_THAT(why.message(),
               Contains("track") && Contains("waypoints[") && Contains("longer than 1000 bytes (max_json_bytes)"));
}

TEST_CASE("JSON is nested as deep as the limit allows, and brackets in texts do not count") {
    auto nested = [](std::size_t levels) {
        return "{\"unknown\":" + std::string(levels - 1, '[') + std::string(levels - 1, ']') + "}";
    };
    CHECK_THAT(message(nested(64)), Contains("no such field"));
    auto deep = failure_of([&] { ise::from_json<track>(nested(65)); });
    CHECK(deep.code() == ise::errc::too_large);
    CHECK_THAT(deep.message(), Contains("nested deeper than 64 levels (max_depth)"));
    CHECK(failure_of([] { ise::from_json<track>(std::string(1 << 20, '[')); }).code() == ise::errc::too_large);
    auto read = ise::from_json<track>(R"({"waypoints":[{"name":"\")" + std::string(500, '{') + R"("}]})");
    CHECK(read.waypoints.at(0).name == "\"" + std::string(500, '{'));
}

TEST_CASE("a long list of packets costs no more than its length") {
    // Half a million: with a look at each for each other one this would not end.
    constexpr std::size_t count = 500'000;
    std::string json = R"({"waypoints":[{})";
    for (std::size_t n = 1; n < count; ++n) json += ",{}";
    CHECK(ise::from_json<track>(json + "]}").waypoints.size() == count);
}

} // namespace json_test
