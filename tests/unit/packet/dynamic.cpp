#include "examples.hpp"

#include <ise/packet/dynamic.hpp>
#include <support/catch.hpp>

namespace dynamic_test {

using namespace example;
using ise_test::Contains;

namespace {
struct waypoint_more {
    std::string name;
    double latitude_deg = 0;
    double longitude_deg = 0;
    int depth_m = 12;
};

/// As a program that never saw the struct gets it: schema from text, packet from bytes.
ise::dynamic_packet received() {
    auto schema = ise::schema::parse(ise::schema_of<everything>().text());
    return ise::dynamic_packet(schema.value(), ise::encode(filled()));
}
} // namespace

TEST_CASE("a packet is read by path with nothing but its schema") {
    auto packet = received();
    CHECK(packet.field("waypoints[1].latitude_deg").as_double() == 3);
    CHECK(packet.field("waypoints[1].name").as_string() == "bc");
    CHECK(packet.field("waypoints").size() == 2);
    CHECK(packet.field("yes").as_bool());
    CHECK(packet.field("i8").as_int() == -1);
    CHECK(packet.field("i8").as<int>() == -1);
    CHECK(packet.field("u64").as_uint() == 1);
    CHECK(packet.field("f").as<float>() == 0.5F);
    CHECK(packet.field("helm").as_string() == "autopilot");
    CHECK(packet.field("helm").as_int() == 1);
    CHECK(packet.field("matrix[1][0]").as_int() == 3);
    CHECK(packet.field("pair_of_i16[1]").as_int() == 300);
    CHECK(packet.field("home.name").as_string() == "home");
    CHECK(packet.field("choice").kind() == ise::type_kind::variant);
    CHECK(packet.field("parameters.trim").as_double() == -1);
    CHECK(packet.field("names[0]").as_string() == "z"); // sorted by encoded key: 256 is 00 01
    CHECK(packet.field("couple.1").as_bool());
    CHECK(packet.field("period").as_double() == 1.5);
    CHECK(packet.field("nested.speed_kn").as_double() == 2);
    CHECK(packet.field("nothing").to_json() == "{}");
    CHECK(packet.field("waypoints[0]").to_json() == R"({"name":"a","latitude_deg":1,"longitude_deg":2})");
    CHECK(packet.to_json() == ise::to_json(filled()));
    CHECK(ise::to_dynamic(everything{}).field("home").is_null());
}

TEST_CASE("a path that leads nowhere, or a value of another kind, says so") {
    auto packet = received();
    auto why = [&](std::string_view path) { return failure_of([&] { packet.field(path); }).message(); };
    CHECK(why("waypoints[2].name") == "no field 'waypoints[2].name': element 2 of 2 in 'waypoints'");
    CHECK(why("waypoints[0].lat") ==
          "no field 'waypoints[0].lat': 'lat' is none of name, latitude_deg, longitude_deg in 'waypoints[0]'");
    CHECK_THAT(why("waypoints[x]"), Contains("expected [number]"));
    CHECK_THAT(why("waypoints[99999999999999999999]"), Contains("expected [number]"));
    CHECK_THAT(why("text.size"), Contains("string has no fields"));
    CHECK_THAT(why("nested[0]"), Contains("has no elements"));
    CHECK_THAT(why("parameters.none"), Contains("no key 'none'"));
    CHECK(failure_of([&] { packet.field("text").as_double(); }).message() == "text: is string, not a number");
    CHECK(failure_of([&] { packet.field("i8").as_uint(); }).code() == ise::errc::type_mismatch);
    CHECK(failure_of([&] { packet.field("names[0]").as_bool(); }).code() == ise::errc::type_mismatch);
    CHECK_THAT(failure_of([&] { packet.field("pair_of_i16[1]").as<std::uint8_t>(); }).message(),
               Contains("up to 255 (it is 300)"));
}

TEST_CASE("a dynamic packet is made from JSON and becomes a typed one, newer or older") {
    auto packet = ise::dynamic_packet::from_json(ise::schema_of<waypoint>(), R"({"name":"buoy","latitude_deg":28})");
    CHECK(packet.as<waypoint>() == waypoint{"buoy", 28, 0});
    CHECK(packet.as<waypoint_more>().depth_m == 12);
    CHECK(ise::to_dynamic(waypoint_more{"x", 1, 2, 3}).as<waypoint>() == waypoint{"x", 1, 2});
    auto why = failure_of([&] { packet.as<position>(); });
    CHECK(why.code() == ise::errc::type_mismatch);
    CHECK_THAT(why.message(), Contains("'latitude_deg' as field 1"));
}

TEST_CASE("bytes that are no such packet never become a dynamic packet") {
    ise::bytes whole = ise::encode(filled());
    for (std::size_t size = 0; size < whole.size(); ++size) {
        ise::bytes cut(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size));
        CHECK_THROWS_AS(ise::dynamic_packet(ise::schema_of<everything>(), cut), ise::error);
    }
    for (std::size_t bit = 0; bit < whole.size() * 8; ++bit) { // the run-time walk and the typed decoder agree
        ise::bytes flipped = whole;
        flipped[bit / 8] ^= static_cast<std::byte>(1u << bit % 8);
        bool walked = failure_of([&] {
                          ise::dynamic_packet(ise::schema_of<everything>(), flipped).to_json();
                      }).message() == "nothing was thrown";
        bool decoded = ise::try_decode<everything>(flipped).has_value();
        CHECK((walked || !decoded)); // duplicates of keys are the typed decoder's to refuse
    }
}

} // namespace dynamic_test
