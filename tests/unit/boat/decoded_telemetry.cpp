#include <components/boat/decoded_telemetry.hpp>
#include <components/boat/services.hpp>
#include <components/boat/telemetry.hpp>

#include <ise/packet/json.hpp>

#include <support/catch.hpp>

namespace decoded_telemetry_test {

using namespace atirma;
using ise_test::Contains;

namespace {

telemetry_packet packet_of(const telemetry_body& body) {
    telemetry_packet made;
    made.link = link_id::gprs;
    made.boot = 3;
    made.sequence = 17;
    packet_header header{3, 17, utc_time(std::chrono::milliseconds(1'500'000'000'123))};
    made.raw = encode_telemetry(header, body);
    return made;
}

} // namespace

TEST_CASE("a line of telemetry is decoded: the fields of the boat's report are in the place of its bytes") {
    wind blows;
    blows.true_direction_deg = 30.5f;
    auto got = decoded_telemetry(ise::to_json(packet_of(blows)));
    REQUIRE(got);
    CHECK_THAT(*got, Contains(R"("link":"gprs","boot":3,"sequence":17)") && Contains(R"("kind":"wind","report":{)") &&
                         Contains(R"("true_direction_deg":30.5)") && !Contains("raw"));
    navigation steers;
    steers.mode = sailing_mode::return_home;
    CHECK_THAT(decoded_telemetry(ise::to_json(packet_of(steers))).value(),
               Contains(R"("kind":"navigation")") && Contains(R"("mode":"return_home")"));
    notice says;
    says.text = R"("raw":"")";
    CHECK_THAT(decoded_telemetry(ise::to_json(packet_of(says))).value(),
               Contains(R"x("report":{"text":"\"raw\":\"\""})x"));
}

TEST_CASE("a line of `ise echo --losses` keeps its envelope") {
    auto line = R"({"lost_before":null,"packet":)" + ise::to_json(packet_of(power())) + "}";
    auto got = decoded_telemetry(line);
    REQUIRE(got);
    CHECK(got->starts_with(R"({"lost_before":null,"packet":{)"));
    CHECK(got->ends_with("}}"));
    CHECK_THAT(*got, Contains(R"("kind":"power")"));
}

TEST_CASE("what is no telemetry, or no report of the boat, is said to be none") {
    CHECK(decoded_telemetry("hello").error().code() == ise::errc::malformed);
    CHECK(decoded_telemetry(R"({"lost_before":3})").error().code() == ise::errc::malformed);
    CHECK(decoded_telemetry(R"({"sail":1})").error().code() == ise::errc::malformed);
    auto damaged = packet_of(location());
    damaged.raw[20] ^= std::byte{1};
    CHECK_THAT(decoded_telemetry(ise::to_json(damaged)).error().message(), Contains("checksum"));
}

} // namespace decoded_telemetry_test
