#include <components/boat/layout.hpp>
#include <components/boat/parameters.hpp>
#include <components/boat/services.hpp>
#include <components/boat/telecommand.hpp>

#include <ise/packet/adapt.hpp>
#include <ise/packet/compatibility.hpp>
#include <ise/packet/json.hpp>

#include <support/catch.hpp>

#include <fmt/format.h>

#include <chrono>
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
    return {at,
            nav,
            wind{-45.5f, 6.25f, 30.5f, 5.75f},
            power{13.125f, -0.5f, 87, 31.5f, 86400, reset_cause::watchdog, 5},
            list,
            config,
            link_status{link_id::gprs, true, -71, 3, 100, 2, 1, 12.5f},
            notice{"tacked at the corridor's edge"}};
}

void flip(ise::bytes& raw, std::size_t at) { raw[at] ^= std::byte{1}; }

ise::bytes resealed(ise::bytes raw) {
    raw.resize(raw.size() - 2);
    auto crc = layout::crc16(raw);
    raw.push_back(static_cast<std::byte>(crc & 0xFF));
    raw.push_back(static_cast<std::byte>(crc >> 8));
    return raw;
}

telecommand encodable(boat_command what) {
    telecommand made;
    made.id = 1000 + static_cast<unsigned>(what.kind());
    made.sent_at = header().measured_at;
    made.command = std::move(what);
    return made;
}

struct recorded_telecommand {
    telecommand command;
    std::string_view raw; ///< as boats in service know it
};

std::vector<recorded_telecommand> all_commands() {
    using namespace commands;
    const waypoint point{28.16, -15.452};
    return {
        {encodable(ping()), "01400000E80300007B98F73E5D0100F34A"},
        {encodable(set_mode{sailing_mode::return_home}), "01400000E90300007B98F73E5D010103A91A"},
        {encodable(waypoint_add{point}), "01400000EA0300007B98F73E5D010200E0C8104036CAF6DA3A"},
        {encodable(waypoint_insert{4, point}), "01400000EB0300007B98F73E5D01030400E0C8104036CAF65886"},
        {encodable(waypoint_delete{4}), "01400000EC0300007B98F73E5D0104041A9B"},
        {encodable(waypoint_clear()), "01400000ED0300007B98F73E5D01055893"},
        {encodable(waypoint_read_back()), "01400000EE0300007B98F73E5D0106C1DB"},
        {encodable(waypoint_select{4}), "01400000EF0300007B98F73E5D010704D6CB"},
        {encodable(set_parameter{parameter_id::leeway_compensation, 0.25f}),
         "01400000F00300007B98F73E5D0108040000803E9929"},
        {encodable(get_parameter{parameter_id::leeway_compensation}), "01400000F10300007B98F73E5D0109041FCF"},
        {encodable(tack_now()), "01400000F20300007B98F73E5D010AB9BC"},
        {encodable(gybe_now()), "01400000F30300007B98F73E5D010BD174"},
        {encodable(set_telemetry_period{link_id::iridium, 600}), "01400000F40300007B98F73E5D010C0200001644FF0F"},
        {encodable(request_status()), "01400000F50300007B98F73E5D010DE3E5"},
        {encodable(reboot()), "01400000F60300007B98F73E5D010E7AAD"},
        {encodable(emergency_beacon{false}), "01400000F70300007B98F73E5D010F00032E"},
        {encodable(mission_stage{4, point}), "01400000F80300007B98F73E5D01100400E0C8104036CAF68796"},
        {encodable(mission_switch{5, 0x01020304}), "01400000F90300007B98F73E5D01110504030201E841"},
        {encodable(raw{"hex:0A1B"}), "01400000FA0300007B98F73E5D0112020A1BF578"},
    };
}

std::string hex(ise::bytes_view raw) {
    std::string made;
    for (auto byte : raw) made += fmt::format("{:02X}", std::to_integer<unsigned>(byte));
    return made;
}

} // namespace

TEST_CASE("the checksum is CRC-16/CCITT as the README states") {
    CHECK(layout::crc16(ise::as_bytes("123456789")) == 0x29B1);
}

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
    CHECK(std::get<waypoints>(parse_telemetry(encode_telemetry(header(), samples()[4]))->body) ==
          std::get<waypoints>(samples()[4]));
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
    CHECK_THAT(parse_telemetry(resealed(raw)).error().message(), ise_test::Contains("version 9"));
}

TEST_CASE("a time after 2200 is refused in every packet, because clocks cannot count with it") {
    auto at = [](std::int64_t ms) {
        auto made = header();
        made.measured_at = utc_time(std::chrono::milliseconds(ms));
        return made;
    };
    constexpr std::int64_t last = 7'258'118'400'000, most = 281'474'976'710'655; // 2200-01-01, 48 bits
    telecommand order;
    order.valid_for = std::chrono::minutes(1);
    order.command = commands::ping();
    acknowledgement answer;
    for (auto ms : {last, last + 1, most}) {
        order.sent_at = at(ms).measured_at;
        answer.header = at(ms);
        CAPTURE(ms);
        auto telemetry = parse_telemetry(encode_telemetry(at(ms), notice{"A"}));
        CHECK(bool(telemetry) == (ms == last));
        CHECK(bool(parse_telecommand(encode_telecommand(order))) == (ms == last));
        CHECK(bool(parse_acknowledgement(encode_acknowledgement(answer))) == (ms == last));
        if (!telemetry) CHECK(telemetry.error().message() == "a time after 2200");
    }
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
    CHECK(cut.text == std::string(77, 'x')); // never half a character
    CHECK_THROWS_AS(encode_telemetry({}, waypoints{0, 10, 0, 0, std::vector<waypoint>(10)}), ise::error);
}

TEST_CASE("every telecommand comes back as it was sent") {
    for (const auto& [command, recorded] : all_commands()) {
        CAPTURE(name_of(command.command.kind()));
        auto raw = encode_telecommand(command);
        CHECK(hex(raw) == recorded);
        CHECK(raw.size() <= max_packet_size);
        CHECK(classify(raw) == packet_class::telecommand);
        auto back = parse_telecommand(raw);
        REQUIRE(back);
        CHECK(encode_telecommand(*back) == raw);
        CHECK(*back == command);
        for (std::size_t i = 0; i < raw.size(); ++i) {
            auto bad = raw;
            flip(bad, i);
            CHECK_FALSE(parse_telecommand(bad));
        }
    }
}

TEST_CASE("a telecommand under authority carries its epoch, and one without is what it always was") {
    for (auto [command, recorded] : all_commands()) {
        CAPTURE(name_of(command.command.kind()));
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
        CHECK(back->command == command.command);
        CHECK(encode_telecommand(*back) == raw);
        for (std::size_t i = 0; i < raw.size(); ++i) {
            auto bad = raw;
            flip(bad, i);
            CHECK_FALSE(parse_telecommand(bad));
        }
    }
}

TEST_CASE("a telecommand that is valid for a time says so, in hundredths of a second, and by which clock") {
    auto hold = encodable(commands::set_mode{sailing_mode::return_home});
    hold.authority = 0x01020304;
    hold.valid_for = std::chrono::minutes(1);
    hold.clock_of = 513;
    CHECK(hex(encode_telecommand(hold)) == "01450102E90300007B98F73E5D01040302017017000103271F");
    for (auto [command, recorded] : all_commands()) {
        CAPTURE(name_of(command.command.kind()));
        command.valid_for = std::chrono::milliseconds(86'400'000);
        command.authority = 7;
        command.clock_of = 65535;
        auto raw = encode_telecommand(command);
        CHECK(raw.size() <= 34); // sealed it has 12 bytes more
        CHECK(classify(raw) == packet_class::telecommand);
        auto back = parse_telecommand(raw);
        REQUIRE(back);
        CHECK(*back == command);
        for (std::size_t i = 0; i < raw.size(); ++i) {
            auto bad = raw;
            flip(bad, i);
            CHECK_FALSE(parse_telecommand(bad));
        }
    }
    hold.valid_for = std::chrono::milliseconds(1239); // never longer than it was given
    CHECK(parse_telecommand(encode_telecommand(hold))->valid_for == std::chrono::milliseconds(1230));
    hold.valid_for = std::chrono::milliseconds(-5);
    CHECK(parse_telecommand(encode_telecommand(hold))->valid_for == std::chrono::milliseconds(0));
    hold.valid_for = std::chrono::hours(1000);
    CHECK(parse_telecommand(encode_telecommand(hold))->valid_for == telecommand::max_valid_for);
}

TEST_CASE("an acknowledgement carries the epoch that the boat obeys as a number, and one of a boat without is what it "
          "always was") {
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
    for (auto asks : {ping, get_parameter, waypoint_read_back, request_status})
        CHECK_FALSE(traits_of(asks).needs_authority);
    for (auto acts : {set_mode, waypoint_add, waypoint_clear, tack_now, reboot, emergency_beacon, set_telemetry_period})
        CHECK(traits_of(acts).needs_authority);
    CHECK(traits_of(static_cast<command_kind>(200)).needs_authority);
    for (auto bad : {reboot, emergency_beacon, waypoint_clear, set_mode})
        CHECK_FALSE(boat_command(bad).danger().empty());
    CHECK(boat_command(commands::set_mode{sailing_mode::hold}).danger().empty());
    CHECK(boat_command(commands::mission_switch{3, 1}).danger().empty());
    CHECK_FALSE(boat_command(commands::mission_switch()).danger().empty()); // to no list at all
    CHECK(boat_command().danger().empty());
}

TEST_CASE("the list of telecommands is consistent") {
    std::vector<command_kind> kinds;
    for_each_telecommand([&]<class C>(const C& each) {
        kinds.push_back(C::traits.kind);
        CHECK(name_of(C::traits.kind) == ise::type_name<C>); // the struct is called like its number
        CHECK_FALSE(C::traits.help.empty());
        CHECK(boat_command(C::traits.kind) == boat_command(each));
        if constexpr (requires { each.ranges(); })
            for (const auto& range : each.ranges()) CHECK(std::ranges::count(ise::field_names<C>, range.argument) == 1);
    });
    std::ranges::sort(kinds);
    std::vector<command_kind> named;
    for (const auto& entry : names_of<command_kind>()) named.push_back(entry.value);
    CHECK(kinds == named);
}

TEST_CASE("an argument out of its range is refused with its name and range") {
    auto refusal = [](boat_command command) { return check(command).error().message(); };
    for (const auto& [command, recorded] : all_commands()) CHECK(check(command.command));
    CHECK(refusal(commands::set_mode{static_cast<sailing_mode>(77)}) == "no mode has number 77");
    CHECK(refusal(commands::set_parameter{static_cast<parameter_id>(77), 1}) == "no parameter has number 77");
    CHECK(refusal(commands::set_parameter{parameter_id::forbidden_angle_upwind, 5}) ==
          "forbidden_angle_upwind is 30 to 85 deg, not 5");
    CHECK(refusal(commands::set_telemetry_period{static_cast<link_id>(9), 5}) == "no link has number 9");
    CHECK(refusal(commands::set_telemetry_period{link_id::gprs, -1}) ==
          "period_s is 0 (off) or 0.5 to 86400 s, not -1");
    CHECK(check(commands::set_telemetry_period{link_id::gprs, 0}));
    CHECK_THAT(refusal(commands::set_telemetry_period{link_id::gprs, std::nanf("")}), ise_test::Contains("not nan"));
    CHECK_THAT(refusal(commands::waypoint_add{{91, 0}}),
               ise_test::Contains("point is") && ise_test::Contains("91, 0 is not a place on the globe"));
    CHECK(refusal(boat_command(static_cast<command_kind>(200))) == "no telecommand has number 200");
}

TEST_CASE("messages and records of telecommands are as older programs know them") {
    auto older =
        ise::schema::parse( // recorded; telecommands and arguments may have been added at its ends since
            "struct boat_command{kind:enum "
            "command_kind:u8{ping=0,set_mode=1,waypoint_add=2,waypoint_insert=3,waypoint_delete=4,"
            "waypoint_clear=5,waypoint_read_back=6,waypoint_select=7,set_parameter=8,get_parameter=9,tack_now=10,gybe_"
            "now=11,"
            "set_telemetry_period=12,request_status=13,reboot=14,emergency_beacon=15},mode:enum "
            "sailing_mode:u8{manual=0,hold=1,"
            "automatic=2,return_home=3,station_keep=4},index:u8,point:struct "
            "waypoint{latitude_deg:f64,longitude_deg:f64},"
            "parameter:enum parameter_id:u8{time_to_next_tack=0,forbidden_angle_upwind=1,forbidden_angle_downwind=2,"
            "telemetry_period=3,leeway_compensation=4},value:f32,link:enum "
            "link_id:u8{xbee=0,gprs=1,iridium=2},period_s:f32,"
            "on:bool=01}")
            .value();
    const auto& now = ise::schema_of<boat_command>();
    CHECK(ise::incompatibility(now, older).value_or("") == "");
    CHECK(ise::incompatibility(older, now).value_or("") == "");
    boat_command insert = commands::waypoint_insert{4, {28.16, -15.452}};
    auto raw = ise::adapt(now, older, ise::encode(insert));
    CHECK(hex(raw) == "030004295C8FC2F5283C408195438B6CE72EC00000000000000000000001");
    CHECK(ise::decode<boat_command>(ise::adapt(older, now, raw)) == insert);
    const char* json =
        R"({"kind":"waypoint_insert","mode":"manual","index":4,"point":{"latitude_deg":28.16,"longitude_deg":-15.452},)"
        R"("parameter":"time_to_next_tack","value":0,"link":"xbee","period_s":0,"on":true})";
    CHECK(ise::to_json(older, raw) == json);
    CHECK(ise::from_json<boat_command>(json) == insert); // as records on disk have it
    for (const auto& [command, recorded] : all_commands())
        CHECK(ise::decode<boat_command>(ise::encode(command.command)) == command.command);
    auto newer = ise::encode(insert);
    newer[0] = std::byte{200};
    CHECK(ise::decode<boat_command>(newer).kind() == static_cast<command_kind>(200));
}

TEST_CASE("a command of a newer shore is understood as unknown, not as damaged") {
    telecommand ping;
    ping.id = 9;
    auto raw = encode_telecommand(ping);
    raw[14] = std::byte{200};
    auto back = parse_telecommand(resealed(raw));
    REQUIRE(back);
    CHECK(back->id == 9);
    CHECK(back->command == boat_command(static_cast<command_kind>(200)));
}

TEST_CASE("an acknowledgement carries id, result, value and text") {
    acknowledgement ack{header(),
                        42,
                        command_kind::set_parameter,
                        ack_code::bad_argument,
                        60,
                        "forbidden_angle_upwind is 30 to 85 deg, not 5"};
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
    CHECK_THAT(check_parameter(parameter_id::forbidden_angle_upwind, 5).error().message(),
               ise_test::Contains("30 to 85 deg"));
    CHECK_FALSE(check_parameter(parameter_id::leeway_compensation, std::nanf("")));
    CHECK_FALSE(check_parameter(static_cast<parameter_id>(77), 1));
}

} // namespace packets_test
