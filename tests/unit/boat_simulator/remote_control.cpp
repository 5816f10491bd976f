// The remote control takes the helm from the autopilot, and gives it back.
#include <components/boat_simulator/simulated_boat.hpp>

#include <support/catch.hpp>

#include <cmath>

namespace remote_control_test {

using namespace atirma;
using namespace atirma::simulator;
using namespace std::chrono_literals;

namespace {

struct helmed_boat {
    helmed_boat() : boat(options(), constant_wind({6, 40})) {}
    static boat_options options() {
        boat_options made;
        made.course = find_course("T1")->marks;
        made.epoch = utc_time(1'500'000'000'000ms);
        return made;
    }
    acknowledgement tell(boat_command what) {
        telecommand sent;
        sent.id = ++id;
        sent.command = std::move(what);
        sent.sent_at = boat.clock_now();
        sent.valid_for = 1h;
        return boat.on_packet(link_id::xbee, encode_telecommand(sent)).value();
    }
    void sail(std::chrono::seconds more) { boat.advance(now += more); }
    std::vector<std::string> notices() {
        std::vector<std::string> all;
        for (const auto& raw : boat.take_packets(link_id::xbee)) {
            if (classify(raw) != packet_class::telemetry) continue;
            auto message = parse_telemetry(raw).value();
            if (const auto* text = std::get_if<notice>(&message.body)) all.push_back(text->text);
            if (const auto* n = std::get_if<navigation>(&message.body)) last = *n;
        }
        return all;
    }

    simulated_boat boat;
    std::chrono::seconds now{};
    std::uint32_t id = 0;
    navigation last; ///< as it was sent
};

} // namespace

TEST_CASE("remote control: it has rudder and sail, telemetry says so, and it gives them back to the mode") {
    helmed_boat it;
    it.sail(60s);
    it.notices();
    CHECK_FALSE(it.last.remote_control);
    it.boat.set_remote_control(remote_helm{-30, 55});
    it.sail(10s);
    CHECK(it.notices() == std::vector<std::string>{"the remote control has the helm"});
    CHECK(it.last.remote_control);
    CHECK(it.last.rudder_commanded_deg == Approx(-30).margin(0.1));
    CHECK(it.last.sail_commanded_deg == Approx(55).margin(0.1));
    CHECK(it.last.mode == sailing_mode::automatic);
    auto heading = it.boat.navigation_now().heading_deg;
    it.boat.set_remote_control(remote_helm{30, 55});
    it.sail(20s);
    CHECK(it.notices().empty()); // it only moved them
    CHECK(std::abs(it.boat.navigation_now().heading_deg - heading) > 20);
    it.boat.set_remote_control(std::nullopt);
    it.sail(10s);
    CHECK(it.notices() == std::vector<std::string>{"the remote control released the helm: mode automatic"});
    for (int minute = 0; minute < 30; ++minute) {
        it.sail(60s);
        it.notices();
    }
    CHECK_FALSE(it.last.remote_control);
    CHECK(std::abs(it.last.cross_track_error_m) < 40); // it found back to its leg
}

TEST_CASE("remote control: telecommands that steer are refused meanwhile and say why, all others are executed") {
    helmed_boat it;
    it.sail(10s);
    it.boat.set_remote_control(remote_helm{});
    for (const boat_command& steers :
         {boat_command(commands::set_mode{sailing_mode::hold}), boat_command(commands::waypoint_select{1}),
          boat_command(commands::tack_now()), boat_command(commands::gybe_now())}) {
        auto answer = it.tell(steers);
        CHECK(answer.code == ack_code::refused);
        CHECK(answer.text == "the remote control has the helm until it is released");
    }
    CHECK(it.boat.pilot().mode() == sailing_mode::automatic);
    CHECK(it.boat.pilot().active() == 0);
    CHECK(it.tell(commands::ping()).code == ack_code::done);
    CHECK(it.tell(commands::waypoint_add{{28.156, -15.452}}).code == ack_code::done);
    CHECK(it.tell(commands::set_parameter{parameter_id::time_to_next_tack, 300}).code == ack_code::done);
    it.boat.set_remote_control(std::nullopt);
    CHECK(it.tell(commands::set_mode{sailing_mode::hold}).code == ack_code::done);
}

TEST_CASE("remote control: it steers while the computer starts, and manual keeps what it left") {
    helmed_boat it;
    it.sail(10s);
    REQUIRE(it.tell(commands::set_mode{sailing_mode::manual}).code == ack_code::done);
    REQUIRE(it.tell(commands::reboot()).code == ack_code::done);
    it.boat.set_remote_control(remote_helm{20, 30});
    it.sail(2s);
    REQUIRE(it.boat.starting());
    CHECK(it.boat.navigation_now().rudder_commanded_deg == Approx(20));
    it.sail(20min); // longer than a mode without a new command
    CHECK(it.boat.pilot().mode() == sailing_mode::manual);
    it.boat.set_remote_control(std::nullopt);
    it.sail(60s);
    CHECK(it.boat.navigation_now().rudder_commanded_deg == Approx(20));
    CHECK(it.boat.navigation_now().sail_commanded_deg == Approx(30));
    it.sail(15min);
    CHECK(it.boat.pilot().mode() == sailing_mode::station_keep); // the time counts from its release
}

} // namespace remote_control_test
