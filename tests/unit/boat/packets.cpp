#include <components/boat/layout.hpp>
#include <components/boat/parameters.hpp>
#include <components/boat/telecommand.hpp>

#include <support/catch.hpp>

#include <cmath>

namespace packets_test {

using namespace atirma;

namespace {

packet_header header() { return {513, 70000, utc_time(std::chrono::milliseconds(1'500'000'000'123))}; }

std::vector<telemetry_body> samples() {
    location at{28.1530001, -15.448, fix_quality::gps, 9, 1.15f, 359.5f, 12345.6f};
    navigation nav;
    nav.mode = sailing_mode::station_keep;
    nav.on = tack::starboard;
    nav.in_irons = nav.beacon = true;
    nav.heading_deg = 0.5f;
    nav.heel_deg = -12.5f;
    nav.rudder_commanded_deg = 45;
    nav.waypoint_index = 2;
    nav.waypoint_count = 3;
    nav.distance_to_waypoint_m = 812.5f;
    nav.cross_track_error_m = -29.5f;
    nav.laps = 7;
    waypoints list;
    list.count = 20;
    list.first = 9;
    for (int i = 0; i < 9; ++i) list.entries.push_back({28 + i * 0.25, -15.5});
    configuration config{3, 30, 60, 12.5f, 0.5f, {2, 10, 0}};
    return {at, nav, wind{-45.5f, 6.25f, 30.5f, 5.75f}, power{13.125f, -0.5f, 87, 31.5f, 86400, reset_cause::watchdog, 5}, list, config,
            link_status{link_id::gprs, true, -71, 3, 100, 2, 1, 12.5f}, notice{"tacked at the corridor's edge"}};
}

void flip(ise::bytes& raw, std::size_t at) { raw[at] ^= std::byte{1}; }

ise::bytes resealed(ise::bytes raw) {
    raw.resize(raw.size() - 2);
    auto crc = layout::crc16(raw);
    raw.push_back(static_cast<std::byte>(crc & 0xFF));
    raw.push_back(static_cast<std::byte>(crc >> 8));
    return raw;
}

std::vector<telecommand> commands() {
    std::vector<telecommand> all;
    for (auto& entry : names_of<command_kind>()) {
        telecommand c;
        c.id = 1000 + static_cast<unsigned>(entry.value);
        c.kind = entry.value;
        c.sent_at = header().measured_at;
        all.push_back(c);
    }
    all[1].mode = sailing_mode::return_home;
    all[2].point = all[3].point = {28.16, -15.452};
    all[3].index = all[4].index = all[7].index = 4;
    all[8].parameter = all[9].parameter = parameter_id::leeway_compensation;
    all[8].value = 0.25f;
    all[12].link = link_id::iridium;
    all[12].period_s = 600;
    all[15].on = false;
    return all;
}

} // namespace

TEST_CASE("the checksum is CRC-16/CCITT as the README states") { CHECK(layout::crc16(ise::as_bytes("123456789")) == 0x29B1); }

TEST_CASE("every telemetry packet comes back as it was sent and fits a radio frame") {
    for (auto& body : samples()) {
        CAPTURE(name_of(body));
        auto raw = encode_telemetry(header(), body);
        CHECK(raw.size() <= max_packet_size);
        CHECK(classify(raw) == packet_class::telemetry);
        auto back = parse_telemetry(raw);
        REQUIRE(back);
        CHECK(back->header == header());
        CHECK(name_of(back->body) == name_of(body));
        CHECK(encode_telemetry(back->header, back->body) == raw); // steps of the layout, not of the host's floats
    }
    auto back = parse_telemetry(encode_telemetry(header(), samples()[0]));
    REQUIRE(back);
    auto at = std::get<location>(back->body);
    CHECK(at.latitude_deg == Approx(28.1530001).epsilon(1e-10));
    CHECK(at.course_over_ground_deg == Approx(359.5));
    CHECK(std::get<waypoints>(parse_telemetry(encode_telemetry(header(), samples()[4]))->body) == std::get<waypoints>(samples()[4]));
}

TEST_CASE("the header has the bytes that the README states") {
    auto raw = encode_telemetry(header(), notice{"A"});
    const unsigned wanted[] = {1, 8, 0x01, 0x02, 0x70, 0x11, 0x01, 0x00, 0x7B, 0x8C, 0xEF, 0x3F, 0x5D, 0x01, 1, 'A'};
    auto ms = static_cast<std::uint64_t>(1'500'000'000'123);
    REQUIRE(raw.size() == 18);
    for (std::size_t i = 0; i < 16; ++i) {
        CAPTURE(i);
        if (i >= 8 && i < 14) CHECK(std::to_integer<std::uint64_t>(raw[i]) == ((ms >> (8 * (i - 8))) & 0xFF));
        else CHECK(std::to_integer<unsigned>(raw[i]) == wanted[i]);
    }
}

TEST_CASE("a packet with any byte changed is refused by its checksum") {
    for (auto& body : samples()) {
        auto good = encode_telemetry(header(), body);
        for (std::size_t i = 0; i < good.size(); ++i) {
            auto bad = good;
            flip(bad, i);
            auto parsed = parse_telemetry(bad);
            REQUIRE_FALSE(parsed);
            CHECK(parsed.error().code() == ise::errc::malformed);
        }
    }
}

TEST_CASE("a packet cut or lengthened anywhere is refused even with a good checksum") {
    for (auto& body : samples()) {
        auto good = encode_telemetry(header(), body);
        for (std::size_t n = 2; n < good.size(); ++n) {
            ise::bytes cut(good.begin(), good.begin() + static_cast<std::ptrdiff_t>(n));
            CHECK_FALSE(parse_telemetry(cut));
            CHECK_FALSE(parse_telemetry(resealed(cut)));
        }
        good.push_back(std::byte{0});
        CHECK_FALSE(parse_telemetry(resealed(good)));
    }
    CHECK_FALSE(parse_telemetry({}));
    CHECK_FALSE(parse_telemetry(ise::bytes(5000)));
}

TEST_CASE("refusals say what is wrong") {
    auto raw = encode_telemetry(header(), samples()[1]);
    raw[14] = std::byte{77};
    CHECK(parse_telemetry(resealed(raw)).error().message() == "mode cannot be 77");
    raw[1] = std::byte{0x3F};
    CHECK(parse_telemetry(resealed(raw)).error().message() == "no telemetry packet has type 3F");
    raw[0] = std::byte{9};
    CHECK_THAT(parse_telemetry(resealed(raw)).error().message(), Catch::Contains("version 9"));
}

TEST_CASE("values that the layout cannot hold are clamped, wrapped or zero") {
    location at;
    at.latitude_deg = std::nan("");
    at.speed_over_ground_mps = 1e9f;
    at.course_over_ground_deg = -0.001f;
    at.distance_sailed_m = -5;
    auto back = std::get<location>(parse_telemetry(encode_telemetry({}, at))->body);
    CHECK(back.latitude_deg == 0);
    CHECK(back.speed_over_ground_mps == Approx(655.35));
    CHECK(back.course_over_ground_deg == 0);
    CHECK(back.distance_sailed_m == 0);
    auto cut = std::get<notice>(parse_telemetry(encode_telemetry({}, notice{std::string(79, 'x') + "\u00e9"}))->body);
    CHECK(cut.text == std::string(79, 'x')); // never half a character
    CHECK_THROWS_AS(encode_telemetry({}, waypoints{0, 10, 0, 0, std::vector<waypoint>(10)}), ise::error);
}

TEST_CASE("every telecommand comes back as it was sent") {
    for (auto& command : commands()) {
        CAPTURE(name_of(command.kind));
        auto raw = encode_telecommand(command);
        CHECK(raw.size() <= max_packet_size);
        CHECK(classify(raw) == packet_class::telecommand);
        auto back = parse_telecommand(raw);
        REQUIRE(back);
        CHECK(encode_telecommand(*back) == raw);
        CHECK(back->id == command.id);
        CHECK(back->mode == command.mode);
        CHECK(back->index == command.index);
        CHECK(back->point.latitude_deg == Approx(command.point.latitude_deg));
        CHECK(back->value == command.value);
        CHECK(back->link == command.link);
        CHECK(back->on == command.on);
        for (std::size_t i = 0; i < raw.size(); ++i) {
            auto bad = raw;
            flip(bad, i);
            CHECK_FALSE(parse_telecommand(bad));
        }
    }
}

TEST_CASE("a telecommand under authority carries its epoch, and one without is what it always was") {
    for (auto command : commands()) {
        CAPTURE(name_of(command.kind));
        auto plain = encode_telecommand(command);
        CHECK(plain[1] == std::byte{0x40});
        CHECK(parse_telecommand(plain)->authority == 0);
        command.authority = 0x01020304;
        auto raw = encode_telecommand(command);
        CHECK(raw.size() == plain.size() + 4);
        CHECK(raw.size() <= max_packet_size);
        CHECK(raw[1] == std::byte{0x42});
        CHECK(raw[14] == std::byte{4}); // little-endian, before the kind
        CHECK(classify(raw) == packet_class::telecommand);
        auto back = parse_telecommand(raw);
        REQUIRE(back);
        CHECK(back->authority == command.authority);
        CHECK(back->kind == command.kind);
        CHECK(encode_telecommand(*back) == raw);
        for (std::size_t i = 0; i < raw.size(); ++i) {
            auto bad = raw;
            flip(bad, i);
            CHECK_FALSE(parse_telecommand(bad));
        }
    }
}

TEST_CASE("an acknowledgement carries the epoch that the boat obeys as a number, and one of a boat without is what it always was") {
    acknowledgement ack;
    ack.id = 7;
    ack.kind = command_kind::set_mode;
    ack.code = ack_code::no_authority;
    ack.text = std::string(acknowledgement::max_text, 'x');
    auto plain = encode_acknowledgement(ack);
    CHECK(plain[1] == std::byte{0x41});
    CHECK_FALSE(parse_acknowledgement(plain)->authority);
    for (std::uint32_t epoch : {0u, 1u, 16'777'217u, 0xFFFFFFFFu}) {
        ack.authority = epoch;
        auto raw = encode_acknowledgement(ack);
        CHECK(raw[1] == std::byte{0x43});
        CHECK(raw.size() == plain.size() + 4);
        CHECK(raw.size() <= max_packet_size);
        CHECK(classify(raw) == packet_class::acknowledgement);
        auto back = parse_acknowledgement(raw);
        REQUIRE(back);
        CHECK(*back == ack);
    }
}

TEST_CASE("what only asks needs no authority, and what can lose the boat is dangerous") {
    using enum command_kind;
    for (auto asks : {ping, get_parameter, waypoint_read_back, request_status}) CHECK_FALSE(needs_authority(asks));
    for (auto acts : {set_mode, waypoint_add, waypoint_clear, tack_now, reboot, emergency_beacon, set_telemetry_period}) CHECK(needs_authority(acts));
    for (auto bad : {reboot, emergency_beacon, waypoint_clear}) CHECK(is_dangerous(bad, sailing_mode::automatic));
    CHECK(is_dangerous(set_mode, sailing_mode::manual));
    CHECK_FALSE(is_dangerous(set_mode, sailing_mode::hold));
    CHECK_FALSE(is_dangerous(ping, sailing_mode::manual));
}

TEST_CASE("a command of a newer shore is understood as unknown, not as damaged") {
    telecommand ping;
    ping.id = 9;
    auto raw = encode_telecommand(ping);
    raw[14] = std::byte{200};
    auto back = parse_telecommand(resealed(raw));
    REQUIRE(back);
    CHECK(back->id == 9);
    CHECK_FALSE(is_known(back->kind));
}

TEST_CASE("an acknowledgement carries id, result, value and text") {
    acknowledgement ack{header(), 42, command_kind::set_parameter, ack_code::bad_argument, 60, "forbidden_angle_upwind is 30 to 85 deg, not 5"};
    auto raw = encode_acknowledgement(ack);
    CHECK(classify(raw) == packet_class::acknowledgement);
    auto back = parse_acknowledgement(raw);
    REQUIRE(back);
    CHECK(*back == ack);
    CHECK_FALSE(parse_acknowledgement(encode_telecommand({})));
    CHECK_FALSE(parse_telecommand(raw));
    ack.text = std::string(500, 'y');
    CHECK(encode_acknowledgement(ack).size() <= max_packet_size);
}

TEST_CASE("names and enumerators lead to each other") {
    CHECK(name_of(sailing_mode::return_home) == "return_home");
    CHECK(from_name<sailing_mode>("station_keep") == sailing_mode::station_keep);
    CHECK_FALSE(from_name<sailing_mode>("fly"));
    CHECK(name_of(static_cast<command_kind>(99)) == "unknown");
    for (auto& entry : names_of<command_kind>()) CHECK(from_name<command_kind>(entry.name) == entry.value);
    CHECK(parameters().size() == names_of<parameter_id>().size());
}

TEST_CASE("a parameter out of range is refused with its range") {
    CHECK(check_parameter(parameter_id::forbidden_angle_upwind, 45));
    CHECK_THAT(check_parameter(parameter_id::forbidden_angle_upwind, 5).error().message(), Catch::Contains("30 to 85 deg"));
    CHECK_FALSE(check_parameter(parameter_id::leeway_compensation, std::nanf("")));
    CHECK_FALSE(check_parameter(static_cast<parameter_id>(77), 1));
}

} // namespace packets_test
