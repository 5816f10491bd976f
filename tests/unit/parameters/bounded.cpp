// Numbers that bring their range and unit along: in packets, in JSON, and as parameters.
#include <ise/component/parameter.hpp>
#include <ise/packet/json.hpp>
#include <ise/packet/schema.hpp>

#include <support/catch.hpp>

#include <limits>

namespace bounded_test {

using ise::bounded;
using ise_test::Contains;

namespace {

struct plain_course {
    double heading = 90;
    std::int16_t trim = -5;
    std::uint8_t sails = 2;
    std::vector<double> legs;
};
struct course {
    bounded<double, 0, 360, "degrees"> heading = 90;
    bounded<std::int16_t, -10, 10> trim = -5;
    bounded<std::uint8_t, 1, 3> sails = 2;
    std::vector<bounded<double, -0.5, 0.5>> legs; // a range of fractions, too
};
struct options {
    bounded<double, 0, 40, "m/s"> wind_speed = 6.5;
    bounded<std::int32_t, 1, 9> crew;
    bounded<std::uint64_t, 0, std::numeric_limits<std::uint64_t>::max()> seed = 7;
    bool gusts = true;
    std::string name = "trade";
};

} // namespace

TEST_CASE("a bounded number is a number that is never outside of its range") {
    bounded<double, 0, 360, "degrees"> heading = 90;
    heading = 359.5;
    CHECK(heading + 0.5 == 360.0);
    CHECK_THROWS_WITH((heading = 361.0), "361 is outside of 0 to 360 (degrees)");
    CHECK_THROWS_WITH((heading = std::numeric_limits<double>::quiet_NaN()), Contains("nan is outside"));
    CHECK(heading == 359.5);
    CHECK_THROWS_WITH((bounded<std::int16_t, -10, 10>(11)), "11 is outside of -10 to 10");
    CHECK(bounded<std::int32_t, 1, 9>() == 1);
    CHECK(bounded<std::int32_t, -9, -1>() == -1);
    static_assert(bounded<std::uint8_t, 0, 255>(255) == 255);
}

TEST_CASE(
    "a bounded number travels as its number: same schema, same bytes, and one outside is refused by who reads it") {
    CHECK(ise::schema_of<course>().fingerprint() == ise::schema_of<plain_course>().fingerprint());
    plain_course sent;
    sent.legs = {0.5, -0.25};
    course expected;
    expected.legs = {0.5, -0.25};
    CHECK(ise::encode(sent) == ise::encode(expected));
    auto got = ise::decode<course>(ise::encode(sent));
    CHECK(got.trim == -5);
    CHECK(got.legs.at(1) == -0.25);
    sent.heading = 361;
    auto wrong = ise::try_decode<course>(ise::encode(sent));
    REQUIRE_FALSE(wrong);
    CHECK(wrong.error().code() == ise::errc::malformed);
    CHECK_THAT(wrong.error().message(), Contains("heading") && Contains("361 is outside of 0 to 360 (degrees)"));
    sent.heading = 0;
    sent.legs.push_back(0.75);
    wrong = ise::try_decode<course>(ise::encode(sent));
    REQUIRE_FALSE(wrong);
    CHECK_THAT(wrong.error().message(), Contains("legs") && Contains("0.75 is outside of -0.5 to 0.5"));
}

TEST_CASE("a bounded number is a number in JSON, and the range is said of one outside") {
    course one;
    CHECK(ise::to_json(one) == R"({"heading":90,"trim":-5,"sails":2,"legs":[]})");
    CHECK(ise::from_json<course>(R"({"heading": 12})").heading == 12);
    CHECK(ise::from_json<course>("{}").heading == 90);
    CHECK_THROWS_WITH(ise::from_json<course>(R"({"sails": 4})"),
                      Contains("sails") && Contains("4 is outside of 1 to 3"));
}

TEST_CASE("the fields of a packet are parameters, with the ranges and units of those that are bounded") {
    options of;
    ise::parameter_set set;
    set.add_fields(of);
    set["wind-speed"].described("of the wind").changeable();
    REQUIRE(set.all().size() == 5);
    const auto* wind = set.find("wind-speed");
    REQUIRE(wind);
    CHECK(ise::allowed_values(*wind) == "a number from 0 to 40 (m/s)");
    CHECK(wind->preset == "6.5");
    CHECK(wind->description == "of the wind");
    CHECK(ise::allowed_values(*set.find("crew")) == "an integer from 1 to 9");
    REQUIRE(set.set("wind-speed", "12"));
    CHECK(of.wind_speed == 12);
    REQUIRE(set.change("wind-speed", "13"));
    CHECK(of.wind_speed == 13);
    auto wrong = set.change("wind-speed", "41");
    REQUIRE_FALSE(wrong);
    CHECK(wrong.error().message() == "parameter 'wind-speed' cannot be '41': it must be a number from 0 to 40 (m/s)");
    CHECK(of.wind_speed == 13);
    CHECK_FALSE(set.set("crew", "0"));
    CHECK_FALSE(set.set("crew", "3.5"));
    REQUIRE(set.set("crew", "9"));
    CHECK(of.crew == 9);
    REQUIRE(set.set("seed", "18446744073709551615"));
    CHECK(of.seed == std::numeric_limits<std::uint64_t>::max());
    REQUIRE(set.set("gusts", "false"));
    CHECK_FALSE(of.gusts);
    CHECK_THROWS_WITH(set["crow"], Contains("did you mean 'crew'?"));
    // Widened by hand, it still holds.
    set["crew"].range(0, 100);
    ise::parameter_set wider;
    wider.add("crew", of.crew, "on board").range(0, 100);
    auto refused = wider.set("crew", "50");
    REQUIRE_FALSE(refused);
    CHECK(of.crew == 9);
}

} // namespace bounded_test
