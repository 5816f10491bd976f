// Wildcards in the names of components, and how packets are printed.
#include <apps/ise/exit_code.hpp>
#include <apps/ise/packet_lines.hpp>
#include <apps/ise/pattern.hpp>
#include <apps/ise/text.hpp>

#include <ise/core/counted.hpp>
#include <ise/packet/dynamic.hpp>
#include <ise/packet/json.hpp>
#include <ise/subscription/received.hpp>

#include <support/catch.hpp>

#include <chrono>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

namespace patterns_test {

using namespace ise::cli;
using ise_test::Contains;

TEST_CASE("cli: patterns match parts of paths") {
    CHECK(is_pattern("atirma/*"));
    CHECK(is_pattern("bo?t"));
    CHECK_FALSE(is_pattern("atirma/boat"));

    CHECK(matches("atirma/boat", "atirma/boat"));
    CHECK_FALSE(matches("atirma/boat", "atirma/boats"));
    CHECK_FALSE(matches("atirma/boat", "atirma"));
    CHECK_FALSE(matches("atirma", "atirma/boat"));
    CHECK(matches("atirma/*", "atirma/boat"));
    CHECK_FALSE(matches("atirma/*", "atirma/shore/xbee"));
    CHECK_FALSE(matches("atirma/*", "atirma"));
    CHECK(matches("a*a/b?at", "atirma/boat"));
    CHECK_FALSE(matches("a*a/b?at", "atirma/bat"));
    CHECK(matches("*o*o*", "gozo_rock_foo"));
    CHECK_FALSE(matches("*o*o*x", "gozo_rock_foo"));

    CHECK(matches("**", "atirma/shore/xbee"));
    CHECK(matches("atirma/**", "atirma/boat"));
    CHECK(matches("atirma/**", "atirma/shore/xbee"));
    CHECK(matches("atirma/**", "atirma")); // no further part
    CHECK_FALSE(matches("atirma/**", "atirma2/boat"));
    CHECK(matches("**/xbee", "xbee"));
    CHECK(matches("**/xbee", "atirma/shore/xbee"));
    CHECK_FALSE(matches("**/xbee", "atirma/shore/xbee/more"));
    CHECK(matches("**/shore/*", "atirma/shore/x/shore/y"));
    CHECK(matches("a/**/b/**/c", "a/b/x/b/c"));
    CHECK(matches("a/**/b/**/c", "a/b/c"));
    CHECK_FALSE(matches("a/**/b/**/c", "a/x/c"));
    CHECK(matches("**/a/b", "a/a/b"));
    CHECK_FALSE(matches("", "a"));

    CHECK(prefix_of("atirma/**") == "atirma");
    CHECK(prefix_of("atirma/shore/x*") == "atirma/shore");
    CHECK(prefix_of("**") == "");
    CHECK(prefix_of("atirma/boat") == "atirma/boat");
}

TEST_CASE("cli: a pattern of many wildcards ends soon") {
    std::string path, pattern;
    for (int i = 0; i < 60; ++i) path += "a/", pattern += "**/a/";
    CHECK_FALSE(matches(pattern + "b", path + "c"));
    CHECK_FALSE(matches(std::string(100, '*') + "b", std::string(10'000, 'a')));
}

namespace {

enum class sail : std::uint8_t { down = 0, up = 1 };
struct wind {
    double speed_kn = 0;
    std::string from;
};
struct sample {
    std::uint32_t number = 0;
    wind at;
    sail jib = sail::down;
    std::optional<double> depth_m;
    std::vector<int> legs;
    std::chrono::sys_time<std::chrono::milliseconds> measured_at{};
};

ise::received<ise::dynamic_packet> as_received(const sample& what, std::uint64_t lost = 0,
                                               ise::wall_time at = ise::detail::no_stamp) {
    ise::packet_origin from;
    from.lost_before = lost;
    from.published_at = at;
    return {ise::counted<ise::dynamic_packet>::make(ise::to_dynamic(what)), from};
}

const ise::wall_time noon{std::chrono::sys_days(std::chrono::year(2026) / 5 / 1) + std::chrono::hours(12) +
                          std::chrono::nanoseconds(42)};

} // namespace

TEST_CASE("cli: packets are printed whole, by fields, with their time and losses") {
    sample what{7, {12.5, "NE, \"fresh\""}, sail::up, {}, {1, 2}, {}};
    auto packet = as_received(what, 3, noon);
    packet_format how;
    CHECK(packet_line(how, packet, {}) == packet->to_json() + "\n");
    how.fields = {"at.speed_kn"};
    CHECK(packet_line(how, packet, {}) == "12.5\n");
    how.fields = {"number", "legs[1]", "legs[5]", "depth_m", "jib"};
    CHECK(packet_line(how, packet, {}) == R"({"number":7,"legs[1]":2,"legs[5]":null,"depth_m":null,"jib":"up"})"
                                          "\n");
    how.fields = {"number"};
    how.stamp = how.losses = true;
    CHECK(packet_line(how, packet, {}) ==
          R"({"published_at":"2026-05-01T12:00:00.000000042Z","lost_before":3,"packet":7})"
          "\n");
    CHECK(packet_line(how, packet, {"atirma/boat", "position"}) ==
          R"({"component":"atirma/boat","service":"position","published_at":"2026-05-01T12:00:00.000000042Z",)"
          R"("lost_before":3,"packet":7})"
          "\n");
    CHECK_THAT(packet_line(how, as_received(what, ise::detail::unknown_gap), {}),
               Contains(R"({"published_at":null,"lost_before":null,)"));
}

TEST_CASE("cli: packets as CSV have a column for each field, and quotes where they are needed") {
    sample what{7, {12.5, "NE, \"fresh\""}, sail::up, {}, {1, 2}, {}};
    packet_format how;
    how.csv = true;
    CHECK(csv_heading(how, ise::schema_of<sample>(), false) ==
          "number,at.speed_kn,at.from,jib,depth_m,legs,measured_at\n");
    CHECK(packet_line(how, as_received(what), {}) ==
          "7,12.5,\"NE, \"\"fresh\"\"\",up,,\"[1,2]\",1970-01-01T00:00:00.000Z\n");
    how.stamp = how.losses = true;
    how.fields = {"number"};
    CHECK(csv_heading(how, ise::schema_of<sample>(), true) == "component,service,published_at,lost_before,number\n");
    CHECK(packet_line(how, as_received(what, 2, noon), {"a", "b"}) == "a,b,2026-05-01T12:00:00.000000042Z,2,7\n");
}

TEST_CASE("cli: texts of packets obey no terminal") {
    const std::string commands = "\x1b]0;x\x07\x7f\xc2\x9b[2J\xe2\x80\xae\xf3\xa0\x80\xa1\xff\xc3\xa9";
    sample what{7, {12.5, commands}, sail::up, {}, {}, {}};
    auto packet = as_received(what);
    packet_format how;
    how.fields = {"at.from"};
    const auto json = packet_line(how, packet, {});
    CHECK(json == R"("\u001b]0;x\u0007\u007f\u009b[2J\u202e\udb40\udc21)"
                  "\xef\xbf\xbd\xc3\xa9\"\n");
    CHECK(ise::from_json<wind>("{\"from\":" + json + "}").from ==
          "\x1b]0;x\x07\x7f\xc2\x9b[2J\xe2\x80\xae\xf3\xa0\x80\xa1\xef\xbf\xbd\xc3\xa9");
    how.csv = true;
    CHECK(packet_line(how, packet, {}) == commands + "\n"); // a program reads what was sent
    how.terminal = true;
    const auto csv = packet_line(how, packet, {"a\x1b", "b"});
    CHECK(csv == printable(csv, true));
    how.fields = {commands};
    const auto heading = csv_heading(how, ise::schema_of<sample>(), true);
    CHECK(heading == printable(heading, true));
}

TEST_CASE("cli: JSON of others is one line without what a terminal obeys") {
    CHECK(readable_json("{\"a\":\n[1.50,\t\"\xc2\x9b\x7f\xc3\xa9\"]}\r") ==
          "{\"a\": [1.50, \"\\u009b\\u007f\xc3\xa9\"]} ");
    for (std::string wrong : {"\x1b[2J", "{\"a\":\"\x1b[2J\"}", "\"\xff\"", "1 2", ""})
        CHECK(readable_json(wrong) == "null");
    CHECK(readable_json(std::string(100'000, '[') + std::string(100'000, ']')).size() == 200'000);
}

TEST_CASE("cli: a field that packets do not have is refused with those that they have") {
    const auto& of = ise::schema_of<sample>();
    for (const char* good : {"number", "at", "at.from", "legs[3]", "depth_m"}) CHECK_NOTHROW(check_field(of, good));
    for (const char* bad : {"nummer", "at.to", "number.x", "legs.x", "legs[x]", "legs[", "at[0]", ""})
        CHECK_THROWS_AS(check_field(of, bad), problem);
    CHECK_THROWS_WITH(check_field(of, "at.to"), Contains("no field 'at.to'") && Contains("there is no 'to'"));
}

} // namespace patterns_test
