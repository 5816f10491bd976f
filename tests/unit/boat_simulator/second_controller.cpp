// The second controller: what it tells when the main one or its power fails, and what it does not.
#include <components/boat_simulator/simulated_boat.hpp>

#include <support/catch.hpp>

#include <random>
#include <set>

namespace second_controller_test {

using namespace atirma;
using namespace atirma::simulator;
using namespace std::chrono_literals;

namespace {

struct watched_boat {
    explicit watched_boat(second_controller_options second = second_controller_options(), std::uint64_t seed = 1)
        : boat(options(second, seed), gusting_wind({6, 40}, seed)) {}
    static boat_options options(second_controller_options second, std::uint64_t seed) {
        boat_options made;
        made.course = find_course("T1")->marks;
        made.epoch = utc_time(1'700'000'000'000ms);
        made.seed = seed;
        made.second = second;
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
    void sail(std::chrono::seconds more) {
        for (auto until = now + more; now < until; now += 1s) {
            boat.advance(now + 1s);
            for (const auto& raw : boat.second()->take_packets()) {
                auto message = parse_telemetry(raw).value();
                CHECK(message.header.boot == beacon_boot);
                CHECK(sequences.insert(message.header.sequence).second);
                if (const auto* text = std::get_if<notice>(&message.body)) words.push_back(text->text);
                else fixes.push_back(std::get<location>(message.body));
            }
            of_main += boat.take_packets(link_id::xbee).size();
        }
    }

    simulated_boat boat;
    std::chrono::seconds now{};
    std::uint32_t id = 0;
    std::set<std::uint32_t> sequences;
    std::vector<std::string> words;
    std::vector<location> fixes;
    std::size_t of_main = 0;
};

} // namespace

TEST_CASE("second controller: silent while the main one works, also while that starts") {
    watched_boat it;
    it.sail(10min);
    it.tell(commands::reboot());
    it.sail(10min);
    CHECK(it.words.empty());
    CHECK(it.fixes.empty());
    CHECK_FALSE(it.boat.second()->transmits());
    CHECK(it.boat.second()->battery_percent() == Approx(100));
}

TEST_CASE("second controller: tells position and cause when the main power fails, until the main controller is back") {
    watched_boat it;
    it.sail(60s);
    auto boot = it.boat.boot();
    it.boat.set_main_power(false);
    auto of_main = it.of_main;
    it.sail(9s);
    CHECK(it.fixes.empty());
    it.sail(25min);
    CHECK(it.of_main == of_main);
    REQUIRE(it.words.size() == 1);
    CHECK(it.words[0] == "beacon: main power lost; own battery 100 %");
    CHECK(it.fixes.size() == 3); // at once, and every ten minutes
    CHECK(it.boat.second()->battery_percent() < 100);
    auto truth = it.boat.location_now();
    CHECK(it.fixes.back().latitude_deg == Approx(truth.latitude_deg).margin(0.01));
    CHECK_FALSE(it.boat.on_packet(link_id::xbee, encode_telecommand({})));
    it.boat.set_main_power(true);
    it.sail(5min);
    CHECK(it.words.back() == "beacon: the main controller is back: it tells the position no more");
    CHECK(it.fixes.size() == 3);
    CHECK(it.of_main > of_main);
    CHECK(it.boat.boot() == boot + 1);
    CHECK(it.boat.power_now().last_reset == reset_cause::brown_out);
}

TEST_CASE("second controller: a main controller that hangs has failed after a minute, and starts by its watchdog") {
    watched_boat it;
    it.sail(60s);
    it.boat.set_main_controller(false);
    it.sail(58s);
    CHECK(it.words.empty());
    it.sail(5s);
    REQUIRE(it.words.size() == 1);
    CHECK(it.words[0].starts_with("beacon: main controller silent for 60 s"));
    CHECK(it.fixes.size() == 1);
    it.boat.set_main_controller(true);
    it.sail(30s);
    CHECK(it.words.back().find("is back") != std::string::npos);
    CHECK(it.boat.power_now().last_reset == reset_cause::watchdog);
}

TEST_CASE("second controller: without power of its own it says nothing, and its battery ends") {
    watched_boat it;
    it.sail(10s);
    it.boat.second()->set_power(false);
    it.boat.set_main_power(false);
    it.sail(30min);
    CHECK(it.words.empty());
    it.boat.second()->set_power(true);
    it.sail(2s);
    CHECK(it.fixes.size() == 1);

    second_controller_options small;
    small.battery_wh = 1; // two hours
    small.period_s = 600;
    watched_boat other(small);
    other.boat.set_main_power(false);
    other.sail(3h);
    CHECK(other.fixes.size() == 12);
    CHECK(other.boat.second()->battery_percent() == 0);
    CHECK_FALSE(other.boat.second()->transmits());
}

TEST_CASE("second controller: the emergency beacon switches it on and off, and without one it is refused") {
    watched_boat it;
    it.sail(10s);
    CHECK(it.tell(commands::emergency_beacon{true}).code == ack_code::done);
    it.sail(11min);
    REQUIRE(it.words.size() == 1);
    CHECK(it.words[0].starts_with("beacon: switched on by telecommand"));
    CHECK(it.fixes.size() == 2);
    CHECK(it.boat.navigation_now().beacon);
    CHECK(it.tell(commands::emergency_beacon{false}).code == ack_code::done);
    it.sail(11min);
    CHECK(it.fixes.size() == 2);

    auto options = watched_boat::options({}, 1);
    options.second.reset();
    simulated_boat without(options, constant_wind({6, 40}));
    telecommand on;
    on.id = 1;
    on.command = commands::emergency_beacon{true};
    auto answer = without.execute(on);
    CHECK(answer.code == ack_code::refused);
    CHECK(answer.text == "it has no second controller: nothing would transmit");
}

TEST_CASE("second controller: over seeds of failures, whoever has power and works tells the position, nobody twice") {
    for (std::uint64_t seed = 1; seed <= 40; ++seed) {
        INFO("seed " << seed);
        std::mt19937_64 random(seed);
        watched_boat it({}, seed);
        bool power = true, works = true, second = true;
        for (int step = 0; step < 12; ++step) {
            switch (random() % 4) {
                case 0: it.boat.set_main_power(power = !power); break;
                case 1: it.boat.set_main_controller(works = !works); break;
                case 2: it.boat.second()->set_power(second = !second); break;
                default: break; // goes on as it is
            }
            it.sail(2min); // longer than the time of silence, and a start
            auto fixes = it.fixes.size();
            auto of_main = it.of_main;
            it.sail(11min);
            bool main_runs = power && works;
            CHECK((it.of_main > of_main) == main_runs);
            CHECK((it.fixes.size() > fixes) == (!main_runs && second));
            CHECK(it.boat.second()->transmits() == (!main_runs && second));
            CHECK(it.boat.fails() == !main_runs);
        }
    }
}

} // namespace second_controller_test
