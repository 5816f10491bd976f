#include <components/nmea_bridge/sentences.hpp>
#include <components/nmea_bridge/signalk.hpp>

#include <nlohmann/json.hpp>
#include <support/catch.hpp>

namespace sentences_test {

using namespace atirma;
using namespace std::chrono_literals;

namespace {

constexpr utc_time moment = std::chrono::sys_days(std::chrono::year(2017) / 9 / 4) + 8h + 5min + 6s + 789ms;

template <class P>
heard<P> measured(P value) {
    return heard<P>{std::move(value), moment, moment + 1s, link_id::xbee};
}

location somewhere() {
    location made;
    made.latitude_deg = 28.153;
    made.longitude_deg = -15.448;
    made.quality = fix_quality::gps;
    made.satellites = 9;
    made.speed_over_ground_mps = 1.5f;
    made.course_over_ground_deg = 359.96f;
    return made;
}

nlohmann::json values(const std::string& delta) {
    REQUIRE(delta.ends_with("\n"));
    REQUIRE(delta.find('\n') == delta.size() - 1);
    auto parsed = nlohmann::json::parse(delta);
    CHECK(parsed["context"] == "vessels.self");
    nlohmann::json found;
    for (const auto& one : parsed["updates"][0]["values"]) found[one["path"].get<std::string>()] = one["value"];
    return found;
}

telemetry_packet packet(const telemetry_body& body, utc_time at, std::uint32_t sequence, link_id link = link_id::xbee) {
    telemetry_packet made;
    made.boot = 3;
    made.sequence = sequence;
    made.measured_at = at;
    made.received_at = moment;
    made.link = link;
    packet_header header;
    header.boot = 3;
    header.sequence = sequence;
    header.measured_at = at;
    made.raw = encode_telemetry(header, body);
    return made;
}

} // namespace

TEST_CASE("a checksum is that of the standard's example") {
    CHECK(nmea::sentence("GPGLL,5300.97914,N,00259.98174,E,125926,A") ==
          "$GPGLL,5300.97914,N,00259.98174,E,125926,A*28\r\n");
}

TEST_CASE("a position is RMC, GGA and VTG") {
    auto text = nmea::position(measured(somewhere()));
    CHECK(text.find("$GPRMC,080506.78,A,2809.1800,N,01526.8800,W,2.92,0.0,040917,,,A*") == 0);
    CHECK(text.find("$GPGGA,080506.78,2809.1800,N,01526.8800,W,1,09,,,M,,M,,*") != std::string::npos);
    CHECK(text.find("$GPVTG,0.0,T,,M,2.92,N,5.40,K,A*") != std::string::npos);
    auto edge = somewhere();
    edge.latitude_deg = -0.99999999;
    edge.longitude_deg = 179.99999999;
    text = nmea::position(measured(edge));
    CHECK(text.find("0100.0000,S,18000.0000,E") != std::string::npos);
}

TEST_CASE("no position is said as such") {
    auto text = nmea::no_position(moment);
    CHECK(text.find("$GPRMC,080506.78,V,,,,,,,040917,,,N*") == 0);
    CHECK(text.find("$GPGGA,080506.78,,,,,0,00,,,M,,M,,*") != std::string::npos);
}

TEST_CASE("heading, rudder, heel, wind and battery have sentences of their own") {
    navigation how;
    how.heading_deg = 350;
    how.rudder_measured_deg = -5.5f;
    how.heel_deg = 12.3f;
    how.pitch_deg = -1;
    auto text = nmea::attitude(measured(how));
    CHECK(text.find("$IIHDT,350.0,T*") == 0);
    CHECK(text.find("$IIRSA,-5.5,A,,V*") != std::string::npos);
    CHECK(text.find("$IIXDR,A,12.3,D,ROLL,A,-1.0,D,PTCH*") != std::string::npos);
    wind what;
    what.apparent_angle_deg = -40;
    what.apparent_speed_mps = 7;
    what.true_direction_deg = 20;
    what.true_speed_mps = 6;
    CHECK(nmea::wind_of(measured(what), std::nullopt) == nmea::sentence("IIMWV,320.0,R,13.61,N,A"));
    CHECK(nmea::wind_of(measured(what), measured(how)).find("$IIMWV,30.0,T,11.66,N,A*") != std::string::npos);
    power charge;
    charge.battery_v = 12.6f;
    charge.battery_a = -1.25f;
    CHECK(nmea::battery(measured(charge)) == nmea::sentence("IIXDR,U,12.60,V,BATTERY,I,-1.25,A,BATTERY"));
}

TEST_CASE("Signal K has the same in its own units") {
    auto position = values(signalk::position(measured(somewhere())));
    CHECK(position["navigation.position"]["latitude"].get<double>() == Approx(28.153));
    CHECK(position["navigation.speedOverGround"].get<double>() == Approx(1.5));
    auto whole = nlohmann::json::parse(signalk::position(measured(somewhere())));
    CHECK(whole["updates"][0]["timestamp"] == "2017-09-04T08:05:06.789Z");
    CHECK(whole["updates"][0]["$source"] == "atirma.xbee");
    navigation how;
    how.heading_deg = 270;
    how.rudder_measured_deg = 10;
    how.heel_deg = -5;
    auto attitude = values(signalk::attitude(measured(how)));
    CHECK(attitude["navigation.headingTrue"].get<double>() == Approx(4.71239).margin(1e-4));
    CHECK(attitude["steering.rudderAngle"].get<double>() == Approx(0.17453).margin(1e-4));
    CHECK(attitude["navigation.attitude"]["roll"].get<double>() == Approx(-0.08727).margin(1e-4));
    wind what;
    what.apparent_angle_deg = -40;
    what.true_direction_deg = 300;
    auto blowing = values(signalk::wind_of(measured(what), measured(how)));
    CHECK(blowing["environment.wind.angleApparent"].get<double>() == Approx(-0.69813).margin(1e-4));
    CHECK(blowing["environment.wind.angleTrueWater"].get<double>() == Approx(0.5236).margin(1e-4));
    CHECK_FALSE(values(signalk::wind_of(measured(what), std::nullopt)).contains("environment.wind.angleTrueWater"));
    power charge;
    charge.battery_percent = 80;
    CHECK(
        values(signalk::battery(measured(charge)))["electrical.batteries.main.capacity.stateOfCharge"].get<double>() ==
        Approx(0.8));
    link_status radio;
    radio.link = link_id::gprs;
    radio.up = true;
    radio.rssi_dbm = -71;
    CHECK(values(signalk::link_of(measured(radio)))["communication.links.gprs.rssi"] == -71);
    CHECK(values(signalk::no_position(moment))["navigation.position"].is_null());
}

TEST_CASE("the newest report of each kind is what is known, whatever came when and how") {
    newest_reports known;
    auto first = somewhere(), second = somewhere();
    second.latitude_deg = 28.2;
    REQUIRE(known.take(packet(second, moment, 2, link_id::gprs)) == telemetry_body(location{}).index());
    CHECK_FALSE(known.take(packet(first, moment - 5s, 1))); // late
    CHECK_FALSE(known.take(packet(second, moment, 2)));     // the same over another link
    auto history = packet(first, moment + 1s, 4);
    history.history = true;
    CHECK_FALSE(known.take(history));
    auto no_fix = somewhere();
    no_fix.quality = fix_quality::none;
    CHECK_FALSE(known.take(packet(no_fix, moment + 2s, 5)));
    auto broken = packet(first, moment + 3s, 6);
    broken.raw.back() ^= std::byte{1};
    CHECK_FALSE(known.take(broken));
    CHECK(known.malformed() == 1);
    CHECK(known.location()->value.latitude_deg == Approx(28.2));
    CHECK(known.location()->link == link_id::gprs);
    CHECK_FALSE(known.wind());
    // A clock a day ahead does not stop those that go right.
    auto ahead = packet(first, moment + 24h, 7);
    ahead.received_at = moment - 1s;
    REQUIRE(known.take(ahead) == std::nullopt);
    auto later = packet(first, moment + 4s, 8);
    later.received_at = moment + 5s;
    CHECK(known.take(later));
}

TEST_CASE("Signal K: who connects is greeted, and told what the paths beyond the specification mean") {
    auto made = signalk::identity("A-Tirma", "");
    CHECK(made == signalk::identity("A-Tirma", ""));
    CHECK(made != signalk::identity("B-Tirma", ""));
    REQUIRE(made.starts_with("urn:mrn:signalk:uuid:"));
    CHECK(signalk::is_uuid(made.substr(21)));
    CHECK(signalk::identity("A-Tirma", "705f5f1a-efaf-44aa-9cb8-a0fd6305567c") ==
          "urn:mrn:signalk:uuid:705f5f1a-efaf-44aa-9cb8-a0fd6305567c");
    CHECK_FALSE(signalk::is_uuid("705F5F1A-efaf-44aa-9cb8-a0fd6305567c"));
    CHECK_FALSE(signalk::is_uuid("705f5f1a-efaf-14aa-9cb8-a0fd6305567c"));
    CHECK_FALSE(signalk::is_uuid("705f5f1a-efaf-44aa-9cb8-a0fd6305567"));
    auto hello = nlohmann::json::parse(signalk::hello(made, moment));
    CHECK(hello["self"] == "vessels." + made);
    CHECK(hello["timestamp"] == "2017-09-04T08:05:06.789Z");
    CHECK(hello["version"].is_string());
    auto about = nlohmann::json::parse(signalk::about("A-Tirma", moment))["updates"][0];
    CHECK(about["values"][0]["path"] == "");
    CHECK(about["values"][0]["value"]["name"] == "A-Tirma");
    bool found = false;
    for (const auto& meta : about["meta"])
        if (meta["path"] == "communication.links.xbee.rssi") found = meta["value"]["units"] == "dBm";
    CHECK(found);
}

} // namespace sentences_test
