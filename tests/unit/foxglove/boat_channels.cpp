// A-Tirma's boat in well-known schemas.
#include <components/boat/services.hpp>
#include <components/boat/telemetry.hpp>
#include <components/foxglove_boat/boat_channels.hpp>
#include <components/foxglove_gateway/well_known.hpp>

#include <support/catch.hpp>

#include <nlohmann/json.hpp>

#include <bit>
#include <cmath>
#include <cstring>
#include <map>
#include <numbers>
#include <string>

namespace foxglove_test {
namespace {

using namespace atirma;
using namespace ise::foxglove;
using namespace std::chrono_literals;

// The fields of a protobuf message that are doubles or blocks, by number.
struct fields {
    explicit fields(std::string_view from) {
        auto varint = [&] {
            std::uint64_t value = 0;
            for (int shift = 0;; shift += 7) {
                auto byte = static_cast<std::uint8_t>(from.at(0));
                from.remove_prefix(1);
                value |= std::uint64_t{byte & 0x7fu} << shift;
                if (byte < 0x80) return value;
            }
        };
        while (!from.empty()) {
            auto tag = varint();
            auto number = static_cast<int>(tag >> 3);
            if ((tag & 7) == 0) {
                numbers[number] = varint();
            } else if ((tag & 7) == 1) {
                double value = 0;
                std::memcpy(&value, from.data(), 8); // tests run on little-endian machines
                doubles[number] = value;
                from.remove_prefix(8);
            } else {
                auto size = varint();
                REQUIRE((tag & 7) == 2);
                texts[number] = from.substr(0, size);
                from.remove_prefix(size);
            }
        }
    }
    std::map<int, std::uint64_t> numbers;
    std::map<int, double> doubles;
    std::map<int, std::string> texts;
};

struct sail {
    std::map<std::size_t, std::string> take(const telemetry_body& body) {
        telemetry_packet made;
        made.boot = 1;
        made.sequence = ++sequence;
        made.measured_at = made.received_at = utc_time(std::chrono::milliseconds(1'700'000'000'000 + sequence * 1000));
        packet_header header;
        header.boot = made.boot;
        header.sequence = made.sequence;
        header.measured_at = made.measured_at;
        made.raw = encode_telemetry(header, body);
        std::vector<derived_message> out;
        boat->take(ise::to_dynamic(made), ise::wall_time(made.received_at), out);
        std::map<std::size_t, std::string> all;
        for (auto& one : out) all[one.channel] = one.payload;
        return all;
    }
    static location at(double latitude_deg, double longitude_deg) {
        location made;
        made.quality = fix_quality::gps;
        made.latitude_deg = latitude_deg;
        made.longitude_deg = longitude_deg;
        made.course_over_ground_deg = 90;
        return made;
    }
    std::uint32_t sequence = 0;
    std::unique_ptr<derivation> boat =
        boat_channels("atirma/shore/xbee", ise::dynamic_contract::of(services::telemetry));
};

} // namespace

TEST_CASE("only telemetry has channels of the boat") {
    sail here;
    REQUIRE(here.boat);
    CHECK(here.boat->channels().at(0).topic == "atirma/shore/xbee/fix");
    CHECK(here.boat->channels().at(0).schema.name == "foxglove.LocationFix");
    CHECK_FALSE(boat_channels("x", ise::dynamic_contract::of(services::telecommand)));
    static constexpr ise::subscription<ise::nothing> other{"telemetry"};
    CHECK_FALSE(boat_channels("x", ise::dynamic_contract::of(other)));
}

TEST_CASE("a position is a fix, a frame and a line") {
    sail here;
    navigation how;
    how.heading_deg = 90; // east: no turn
    how.heel_deg = 20;
    CHECK(here.take(how).size() == 1); // the report; no frame without a position
    auto first = here.take(sail::at(28.15, -15.45));
    fields fix(first.at(0));
    CHECK(fix.doubles.at(1) == Approx(28.15));
    CHECK(fix.doubles.at(2) == Approx(-15.45));
    CHECK(fix.doubles.at(13) == Approx(std::numbers::pi / 2));
    CHECK(fields(fix.texts.at(6)).numbers.at(1) == 1'700'000'002);
    fields frame(first.at(1));
    CHECK(frame.texts.at(2) == "map");
    CHECK(frame.texts.at(3) == "boat");
    fields rotation(frame.texts.at(5));
    CHECK(rotation.doubles.at(1) == Approx(std::sin(10 * std::numbers::pi / 180))); // starboard down: about x
    CHECK(rotation.doubles.at(3) == Approx(0).margin(1e-9));
    auto second = here.take(sail::at(28.151, -15.45));
    fields moved(fields(second.at(1)).texts.at(4));
    CHECK(moved.doubles.at(1) == Approx(0).margin(0.1));
    CHECK(moved.doubles.at(2) == Approx(111.2).margin(0.1)); // north is y
    auto line = nlohmann::json::parse(fields(second.at(3)).texts.at(1));
    CHECK(line["geometry"]["coordinates"] == nlohmann::json::array({{-15.45, 28.15}, {-15.45, 28.151}}));
    CHECK_FALSE(here.take(sail::at(28.151001, -15.45)).contains(3)); // it has hardly moved
}

TEST_CASE("the wind blows where the frame's x axis points") {
    sail here;
    here.take(sail::at(28.15, -15.45));
    wind from_north;
    from_north.true_direction_deg = 0;
    auto result = here.take(from_north);
    fields rotation(fields(result.at(2)).texts.at(5));
    // To the south: x turned by -90° (or 270°) about z.
    auto z = rotation.doubles.at(3), w = rotation.doubles.at(4);
    CHECK(2 * std::atan2(z, w) * 180 / std::numbers::pi == Approx(270).margin(1e-6));
    CHECK(result.contains(6));
}

TEST_CASE("a report that cannot be read is left out") {
    sail here;
    telemetry_packet wrong;
    wrong.raw.resize(3);
    std::vector<derived_message> out;
    CHECK_THROWS_AS(here.boat->take(ise::to_dynamic(wrong), ise::wall_time(), out), ise::error);
    CHECK(out.empty());
}

} // namespace foxglove_test
