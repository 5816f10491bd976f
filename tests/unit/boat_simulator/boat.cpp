#include <components/boat_simulator/simulated_boat.hpp>

#include <support/catch.hpp>
#include <support/shared_data.hpp>

#include <nlohmann/json.hpp>

#include <algorithm>
#include <fstream>

namespace boat_test {

using namespace atirma;
using namespace atirma::simulator;
using namespace std::chrono_literals;

namespace {

std::shared_ptr<const wind_source> steady(double speed_mps, double from_deg) {
    return constant_wind({speed_mps, from_deg});
}

std::vector<waypoint> triangle(double side_m) {
    local_chart chart({28.155, -15.453});
    return {chart.to_waypoint({0, 0}), chart.to_waypoint({side_m, 0}), chart.to_waypoint({side_m / 2, side_m * 0.866})};
}

boat_options sailing(std::vector<waypoint> course) {
    boat_options options;
    options.course = std::move(course);
    options.epoch = utc_time(1'500'000'000'000ms);
    return options;
}

telecommand command(std::uint32_t id, boat_command what) {
    telecommand c;
    c.id = id;
    c.command = std::move(what);
    c.sent_at = utc_time(1'500'000'000'000ms);
    c.valid_for = 24h;
    return c;
}

std::vector<telemetry_message> telemetry(simulated_boat& boat, link_id link = link_id::xbee) {
    std::vector<telemetry_message> all;
    for (auto& raw : boat.take_packets(link))
        if (classify(raw) == packet_class::telemetry) all.push_back(parse_telemetry(raw).value());
    return all;
}

template <class P>
std::size_t count(const std::vector<telemetry_message>& all) {
    return static_cast<std::size_t>(
        std::count_if(all.begin(), all.end(), [](auto& m) { return std::holds_alternative<P>(m.body); }));
}

// Sails on in slices, emptying the queue.
void sail(simulated_boat& boat, std::chrono::seconds& now, std::chrono::seconds more) {
    now += more;
    boat.advance(now);
}

} // namespace

TEST_CASE("ten hours around a 600 m triangle give the stated number of laps, never in irons") {
    for (double from : {0.0, 120.0, 250.0}) {
        simulated_boat boat(sailing(triangle(600)), steady(6, from));
        bool irons = false;
        for (int minute = 1; minute <= 600; ++minute) {
            boat.advance(std::chrono::minutes(minute));
            irons |= boat.in_irons();
        }
        CAPTURE(from, boat.pilot().laps());
        CHECK(boat.pilot().laps() >= 7);
        CHECK(boat.pilot().laps() <= 11);
        CHECK_FALSE(irons);
    }
}

TEST_CASE("the same options, wind and commands give the same packets, however time is cut") {
    auto run = [](std::chrono::milliseconds piece) {
        simulated_boat boat(sailing(find_course("T1")->marks), gusting_wind({6, 40}, 3));
        for (std::chrono::milliseconds now{0}; now <= 120s; now += piece) boat.advance(now);
        boat.advance(120s);
        return boat.take_packets(link_id::xbee);
    };
    auto one = run(50ms);
    CHECK(one.size() > 100);
    CHECK(one == run(7s));
}

TEST_CASE("telemetry comes by type at its period, numbered without a gap") {
    simulated_boat boat(sailing(find_course("T2")->marks), steady(6, 40));
    std::chrono::seconds now{0};
    std::vector<telemetry_message> all;
    for (int i = 0; i < 30; ++i) {
        sail(boat, now, 10s);
        for (auto& m : telemetry(boat)) all.push_back(m);
    }
    CHECK(count<location>(all) == 151);
    CHECK(count<navigation>(all) == 151);
    CHECK(count<wind>(all) == 76);
    CHECK(count<power>(all) == 16);
    CHECK(count<waypoints>(all) == 6);
    CHECK(count<configuration>(all) == 6);
    for (std::size_t i = 0; i < all.size(); ++i) {
        CHECK(all[i].header.sequence == i);
        CHECK(all[i].header.boot == 1);
    }
    CHECK(all.back().header.measured_at > utc_time(1'500'000'290'000ms));
    CHECK(boat.take_packets(link_id::gprs).empty()); // off until told
}

TEST_CASE("a queue that nobody empties keeps the newest and counts the rest") {
    simulated_boat boat(sailing(find_course("T1")->marks), steady(6, 40));
    boat.advance(1h);
    CHECK(boat.queued(link_id::xbee) == simulated_boat::max_queued);
    auto all = telemetry(boat);
    CHECK(all.back().header.measured_at > utc_time(1'500'003'590'000ms));
}

TEST_CASE("an answer goes before the telemetry that waits, and is not pushed out by it") {
    simulated_boat boat(sailing(find_course("T1")->marks), steady(6, 40));
    boat.advance(1h); // the link is dead: its queue is full
    REQUIRE(boat.on_packet(link_id::xbee, encode_telecommand(command(7, commands::ping()))));
    REQUIRE(boat.on_packet(link_id::xbee, encode_telecommand(command(8, commands::ping()))));
    boat.advance(2h);
    CHECK(boat.queued(link_id::xbee) == simulated_boat::max_queued + 2);
    CHECK(parse_acknowledgement(boat.take_packet(link_id::xbee)).value().id == 7);
    CHECK(parse_acknowledgement(boat.take_packet(link_id::xbee)).value().id == 8);
    CHECK(classify(boat.take_packet(link_id::xbee)) == packet_class::telemetry);
    for (std::uint32_t id = 100; id < 200; ++id)
        REQUIRE(boat.on_packet(link_id::xbee, encode_telecommand(command(id, commands::ping()))));
    auto all = boat.take_packets(link_id::xbee);
    CHECK(all.size() == simulated_boat::max_answers + simulated_boat::max_queued - 1);
    CHECK(parse_acknowledgement(all.front()).value().id == 200 - simulated_boat::max_answers);
}

// The digest is the same from every compiler, at every optimisation: it is this number in each preset. A change of the
// model, the course or a packet's layout changes it, and then it is taken anew.
TEST_CASE("two hours in gusts give the same packets from every compiler") {
    simulated_boat boat(sailing(find_course("T1")->marks), gusting_wind({6.3, 37}, 11));
    std::uint64_t digest = 0xcbf29ce484222325u; // FNV-1a
    std::size_t count = 0;
    for (int minute = 1; minute <= 120; ++minute) {
        boat.advance(std::chrono::minutes(minute));
        for (const auto& raw : boat.take_packets(link_id::xbee)) {
            ++count;
            for (auto byte : raw) digest = (digest ^ std::to_integer<std::uint64_t>(byte)) * 0x100000001b3u;
        }
    }
    CHECK(count == 9847);
    CHECK(digest == 15489208335775368170u);
}

TEST_CASE("a telecommand over the air takes effect and is acknowledged on the link it came by") {
    simulated_boat boat(sailing(find_course("T1")->marks), steady(6, 40));
    boat.advance(10s);
    boat.take_packets(link_id::xbee);
    auto c = command(77, commands::set_mode{sailing_mode::station_keep});
    REQUIRE(boat.on_packet(link_id::gprs, encode_telecommand(c)));
    auto answers = boat.take_packets(link_id::gprs);
    REQUIRE(answers.size() == 1);
    auto ack = parse_acknowledgement(answers[0]).value();
    CHECK(ack.id == 77);
    CHECK(ack.code == ack_code::done);
    CHECK(boat.navigation_now().mode == sailing_mode::station_keep);
    vec station = boat.state().position_m;
    for (int minute = 1; minute < 60; ++minute) {
        boat.advance(10s + std::chrono::minutes(minute));
        CHECK(length(boat.state().position_m - station) < 120);
    }
    CHECK_FALSE(boat.on_packet(link_id::xbee, ise::as_bytes("hello, this is not a packet")));
    CHECK(boat.refused_packets() == 1);
}

TEST_CASE("a command that arrives twice is done once") {
    simulated_boat boat(sailing({}), steady(6, 40));
    auto add = command(5, commands::waypoint_add{{28.16, -15.45}});
    auto first = boat.execute(add);
    auto again = boat.execute(add);
    CHECK(boat.pilot().list().size() == 1);
    CHECK(again.code == first.code);
    CHECK(again.value == first.value);
    CHECK(again.header.sequence != first.header.sequence);
    auto reboot = command(6, commands::reboot());
    boat.execute(reboot);
    CHECK(boat.boot() == 2);
    boat.advance(20s);
    boat.execute(reboot); // its answer was lost, the boat's memory was not
    CHECK(boat.boot() == 2);
}

TEST_CASE("a boat that repeats an answer names the epoch under which it did what was asked") {
    simulated_boat boat(sailing({}), steady(6, 40));
    auto add = command(1, commands::waypoint_add{{28.16, -15.45}});
    add.authority = 6;
    CHECK(boat.execute(add).authority == 6u);
    auto ping = command(2, commands::ping());
    ping.authority = 8; // the authority has changed hands
    CHECK(boat.execute(ping).authority == 8u);
    auto again = boat.execute(add);
    CHECK(again.code == ack_code::done);
    CHECK(again.authority == 6u);
    CHECK(boat.authority() == 8);
}

TEST_CASE("a boat that heard of an authority refuses what comes under a lower one, and forgets neither over a reboot") {
    simulated_boat boat(sailing({}), steady(6, 40));
    auto add = command(1, commands::waypoint_add{{28.16, -15.45}});
    CHECK(boat.execute(add).code == ack_code::done); // nobody has authority: anybody may
    auto taken = command(2, commands::ping());
    taken.authority = 6;
    CHECK(boat.execute(taken).code == ack_code::done);
    CHECK(boat.authority() == 6);
    add.id = 3;
    for (std::uint32_t lower : {0u, 5u}) {
        add.authority = lower;
        auto no = boat.execute(add);
        CHECK(no.code == ack_code::no_authority);
        CHECK(no.authority == 6u);
        CHECK(no.id == 3);
    }
    CHECK(boat.pilot().list().size() == 1);
    CHECK(boat.execute(command(4, commands::ping())).code == ack_code::done); // it only asks
    add.authority = 6;                                                        // the same id again, now as it should be
    CHECK(boat.execute(add).code == ack_code::done);
    CHECK(boat.pilot().list().size() == 2);
    auto reboot = command(5, commands::reboot());
    reboot.authority = 8;
    CHECK(boat.execute(reboot).code == ack_code::done);
    boat.advance(20s);
    add.id = 9;
    CHECK(boat.execute(add).code == ack_code::no_authority);
    CHECK(boat.authority() == 8);
}

TEST_CASE("a forged epoch far above the boat's does not count, so that the operators ashore still have a higher one") {
    simulated_boat boat(sailing({}), steady(6, 40));
    auto add = command(1, commands::waypoint_add{{28.16, -15.45}});
    for (std::uint32_t forged : {0xFFFFFFFFu, 0x80000000u, simulated_boat::max_epoch_step + 1}) {
        auto ping = command(2, commands::ping());
        ping.authority = forged;
        CHECK(boat.execute(ping).authority == 0u); // it only asks, and is told which epoch counts
        add.authority = forged;
        CHECK(boat.execute(add).code == ack_code::no_authority);
        CHECK(boat.authority() == 0);
    }
    CHECK(boat.pilot().list().empty());
    auto ping = command(3, commands::ping());
    ping.authority = simulated_boat::max_epoch_step;
    CHECK(boat.execute(ping).code == ack_code::done);
    CHECK(boat.authority() == simulated_boat::max_epoch_step);
    ping.id = 4;
    ping.authority = 0xFFFFFFFF;
    CHECK(boat.execute(ping).authority == simulated_boat::max_epoch_step);
    CHECK(boat.authority() == simulated_boat::max_epoch_step);
    add.id = 5;
    add.authority = simulated_boat::max_epoch_step + 2; // the operator ashore takes the authority anew
    CHECK(boat.execute(add).code == ack_code::done);
}

TEST_CASE("the boat says which epoch it obeys exactly, also where a float cannot") {
    boat_options options;
    options.epoch = sailing({}).epoch;
    options.resumed = simulated_boat(sailing({}), steady(6, 40)).remember();
    options.resumed->authority = 16'777'217; // 2^24 + 1
    simulated_boat boat(options, steady(6, 40));
    auto add = command(1, commands::waypoint_add());
    add.authority = 2;
    auto no = parse_acknowledgement(encode_acknowledgement(boat.execute(add)));
    REQUIRE(no);
    CHECK(no->code == ack_code::no_authority);
    CHECK(no->authority == 16'777'217);
}

TEST_CASE("a boat that was left at the last epoch goes on with the first one") {
    boat_options options;
    options.epoch = sailing({}).epoch;
    options.resumed = simulated_boat(sailing({}), steady(6, 40)).remember();
    options.resumed->authority = 0xFFFFFFFF;
    simulated_boat boat(options, steady(6, 40));
    auto add = command(1, commands::waypoint_add{{28.16, -15.45}});
    for (std::uint32_t lower : {0u, 0xFFFFFFFEu, 0x80000000u}) {
        add.authority = lower; // 0 is no epoch, and never the one after the last
        CHECK(boat.execute(add).code == ack_code::no_authority);
    }
    add.authority = 2;
    CHECK(boat.execute(add).code == ack_code::done);
    CHECK(boat.authority() == 2);
    add.id = 2;
    add.authority = 0xFFFFFFFF;
    CHECK(boat.execute(add).code == ack_code::no_authority);
}

TEST_CASE("waypoints are added, inserted, deleted, selected, read back and cleared") {
    simulated_boat boat(sailing({}), steady(6, 40));
    std::uint32_t id = 0;
    auto tell = [&](boat_command what) { return boat.execute(command(++id, std::move(what))); };
    for (int i = 0; i < 12; ++i) tell(commands::waypoint_add{{28.10 + 0.01 * i, -15.45}});
    CHECK(tell(commands::waypoint_insert{2, {28.5, -15.45}}).value == 13);
    CHECK(boat.pilot().list()[2].latitude_deg == 28.5);
    CHECK(tell(commands::waypoint_delete{2}).code == ack_code::done);
    CHECK(tell(commands::waypoint_delete{12}).code == ack_code::bad_argument);
    CHECK(tell(commands::waypoint_insert{99, {28, -15.45}}).text == "no place 99 in a list of 12");
    CHECK(tell(commands::waypoint_select{7}).code == ack_code::done);
    CHECK(boat.navigation_now().waypoint_index == 7);
    boat.advance(1s);
    boat.take_packets(link_id::xbee);
    tell(commands::waypoint_read_back());
    boat.advance(2s);
    std::vector<waypoint> list;
    for (auto& m : telemetry(boat))
        if (auto* part = std::get_if<waypoints>(&m.body)) {
            CHECK(part->count == 12);
            CHECK(part->first == list.size());
            list.insert(list.end(), part->entries.begin(), part->entries.end());
        }
    REQUIRE(list.size() == 12);
    CHECK(list[11].latitude_deg == Approx(28.21));
    tell(commands::waypoint_clear());
    CHECK(boat.pilot().list().empty());
    boat.advance(30min); // nowhere to go: it stays
    CHECK(length(boat.state().position_m) < 250);
    for (int i = 0; i < 100; ++i) tell(commands::waypoint_add{{28.1, -15.45}});
    CHECK(tell(commands::waypoint_add{{28.1, -15.45}}).code == ack_code::refused);
}

TEST_CASE("a boat on station in Auto stays there when its list is cleared") {
    for (bool with_mark : {false, true}) {
        simulated_boat boat(sailing({}), steady(6, 40));
        if (with_mark) boat.execute(command(1, commands::waypoint_add{boat.chart().to_waypoint({200, 0})}));
        boat.advance(30min);
        vec station = boat.state().position_m;
        boat.execute(command(2, commands::waypoint_clear()));
        boat.advance(150min);
        CAPTURE(with_mark);
        CHECK(length(boat.state().position_m - station) < 150);
    }
}

TEST_CASE("a boat on station at its only waypoint stays there when that is deleted") {
    simulated_boat boat(sailing({}), steady(6, 40));
    boat.execute(command(1, commands::waypoint_add{boat.chart().to_waypoint({200, 0})}));
    boat.advance(30min);
    vec station = boat.state().position_m;
    CHECK(length(station - vec{200, 0}) < 100);
    boat.execute(command(2, commands::waypoint_delete{0}));
    boat.advance(150min);
    CHECK(length(boat.state().position_m - station) < 150);
}

TEST_CASE("parameters are set, read and refused with their range") {
    simulated_boat boat(sailing(find_course("T1")->marks), steady(6, 40));
    auto tell = [&](std::uint32_t id, boat_command what) { return boat.execute(command(id, std::move(what))); };
    CHECK(tell(1, commands::set_parameter{parameter_id::forbidden_angle_upwind, 50}).value == 50);
    CHECK(tell(2, commands::get_parameter{parameter_id::forbidden_angle_upwind}).value == 50);
    auto no = tell(3, commands::set_parameter{parameter_id::forbidden_angle_upwind, 5});
    CHECK(no.code == ack_code::bad_argument);
    CHECK(no.value == 50);
    CHECK_THAT(no.text, ise_test::Contains("30 to 85"));
    tell(4, commands::set_parameter{parameter_id::telemetry_period, 10});
    CHECK(boat.configuration_now().telemetry_period_s[0] == 10);
    CHECK(tell(5, commands::set_telemetry_period{link_id::gprs, 5}).code == ack_code::done);
    boat.advance(20s);
    CHECK(count<location>(telemetry(boat, link_id::gprs)) == 5);
    CHECK(tell(6, commands::set_telemetry_period{link_id::gprs, -1}).code == ack_code::bad_argument);
    CHECK(tell(7, boat_command(static_cast<command_kind>(200))).code == ack_code::unknown_command);
}

TEST_CASE("a tack is commanded while beating and refused on a reach") {
    local_chart chart({28.155, -15.453});
    auto options = sailing({chart.to_waypoint({3000, 0})});
    options.start = chart.origin();
    simulated_boat beating(options, steady(6, 90));
    beating.advance(30s);
    auto before = beating.navigation_now();
    CHECK(beating.execute(command(1, commands::tack_now())).code == ack_code::done);
    beating.advance(60s);
    auto after = beating.navigation_now();
    CHECK(std::abs(std::remainder(after.course_to_steer_deg - before.course_to_steer_deg, 360.0)) ==
          Approx(120).margin(1));
    CHECK(std::abs(std::remainder(after.heading_deg - after.course_to_steer_deg, 360.0)) < 25);
    simulated_boat reaching(options, steady(6, 0));
    reaching.advance(30s);
    auto no = reaching.execute(command(1, commands::tack_now()));
    CHECK(no.code == ack_code::refused);
    CHECK_FALSE(no.text.empty());
}

TEST_CASE("return home brings it home, hold keeps its heading, manual leaves the rudder alone") {
    simulated_boat boat(sailing(triangle(600)), steady(8, 20));
    boat.advance(15min);
    auto mode = command(1, commands::set_mode{sailing_mode::return_home});
    boat.execute(mode);
    boat.advance(90min);
    CHECK(length(boat.state().position_m) < 120);
    mode.id = 2;
    mode.command = commands::set_mode{sailing_mode::hold};
    double heading = boat.navigation_now().heading_deg;
    boat.execute(mode);
    boat.advance(92min);
    CHECK(std::abs(std::remainder(boat.navigation_now().heading_deg - boat.navigation_now().course_to_steer_deg,
                                  360.0)) < 15);
    CHECK(std::abs(std::remainder(boat.navigation_now().course_to_steer_deg - heading, 360.0)) <= 60);
    mode.id = 3;
    mode.command = commands::set_mode{sailing_mode::manual};
    boat.execute(mode);
    auto rudder = boat.navigation_now().rudder_commanded_deg;
    boat.advance(93min);
    CHECK(boat.navigation_now().rudder_commanded_deg == rudder);
}

TEST_CASE("a reboot is silent for a while and starts a new boot") {
    simulated_boat boat(sailing(find_course("T1")->marks), steady(6, 40));
    boat.advance(10s);
    boat.on_packet(link_id::xbee, encode_telecommand(command(9, commands::reboot()))).value();
    boat.take_packets(link_id::xbee);
    boat.advance(13s);
    CHECK(boat.take_packets(link_id::xbee).empty());
    CHECK_FALSE(boat.on_packet(link_id::xbee, encode_telecommand(command(10, commands::ping()))));
    boat.advance(20s);
    auto all = telemetry(boat);
    REQUIRE_FALSE(all.empty());
    CHECK(all.front().header.boot == 2);
    CHECK(count<waypoints>(all) >= 1);
    CHECK(boat.power_now().last_reset == reset_cause::commanded);
}

TEST_CASE("a boat put head to wind is in irons, and says so") {
    auto options = sailing(find_course("T1")->marks);
    options.heading_deg = 40;
    simulated_boat boat(options, steady(6, 40));
    boat.advance(30s);
    CHECK(boat.in_irons());
    CHECK(boat.navigation_now().in_irons);
    auto all = telemetry(boat);
    CHECK(count<notice>(all) == 1);
}

TEST_CASE("the boat reports the wind that it has") {
    simulated_boat boat(sailing(find_course("T1")->marks), steady(6, 40));
    boat.advance(60s);
    auto w = boat.wind_now();
    CHECK(w.true_direction_deg == Approx(40));
    CHECK(w.true_speed_mps == Approx(6));
    double bow = std::remainder(40.0 - boat.navigation_now().heading_deg, 360.0);
    CHECK((bow > 0) == (w.apparent_angle_deg > 0));
    CHECK((boat.navigation_now().on == tack::starboard) == (w.apparent_angle_deg > 0));
}

TEST_CASE("all legs of the courses lie in water") {
    auto file = ise_test::shared_data("gran_canaria_gshhg_f.geojson");
    if (!file) {
        WARN("gran_canaria_gshhg_f.geojson is not there (ISE_SHARED_DATA): not tried");
        return;
    }
    std::ifstream in(*file);
    auto ring = nlohmann::json::parse(in)["features"][0]["geometry"]["coordinates"][0];
    auto on_land = [&](double latitude, double longitude) {
        bool inside = false;
        for (std::size_t i = 0, j = ring.size() - 1; i < ring.size(); j = i++) {
            double xi = ring[i][0], yi = ring[i][1], xj = ring[j][0], yj = ring[j][1];
            if ((yi > latitude) != (yj > latitude) && longitude < (xj - xi) * (latitude - yi) / (yj - yi) + xi)
                inside = !inside;
        }
        return inside;
    };
    CHECK(on_land(28.0, -15.6)); // the island's middle
    for (auto name : {"T1", "T2"}) {
        auto marks = find_course(name)->marks;
        for (std::size_t i = 0; i < marks.size(); ++i) {
            auto a = marks[i], b = marks[(i + 1) % marks.size()];
            for (int k = 0; k <= 100; ++k) {
                double part = k / 100.0;
                CHECK_FALSE(on_land(a.latitude_deg + part * (b.latitude_deg - a.latitude_deg),
                                    a.longitude_deg + part * (b.longitude_deg - a.longitude_deg)));
            }
        }
    }
    CHECK_FALSE(find_course("T3"));
}

TEST_CASE("a raw telecommand is refused aboard unless it is switched on, and then its bytes are the controller's") {
    auto off = sailing({});
    simulated_boat without(off, steady(6, 40));
    auto no = without.execute(command(1, commands::raw{"hex:0A1B"}));
    CHECK(no.code == ack_code::refused);
    CHECK(no.text == "raw telecommands are off aboard (--raw-telecommands)");
    CHECK(without.last_raw().empty());
    off.raw_telecommands = true;
    simulated_boat boat(off, steady(6, 40));
    auto raw = encode_telecommand(command(2, commands::raw{"hex:0A1B"}));
    auto yes = boat.on_packet(link_id::gprs, raw).value();
    CHECK(yes.code == ack_code::done);
    CHECK(yes.text == "the controller has 2 bytes");
    CHECK(boat.last_raw() == ise::bytes{std::byte{0x0A}, std::byte{0x1B}});
    boat.set_remote_control(remote_helm{});
    CHECK(boat.execute(command(3, commands::raw{"x"})).code == ack_code::refused);
    CHECK(boat.execute(command(4, commands::raw{})).code == ack_code::bad_argument);
}

} // namespace boat_test
