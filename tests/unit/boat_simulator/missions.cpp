// A list of waypoints changes as a whole.
#include <components/boat/mission_checksum.hpp>
#include <components/boat_simulator/simulated_boat.hpp>

#include <support/catch.hpp>

#include <algorithm>
#include <random>
#include <vector>

namespace missions_test {

using namespace std::chrono_literals;
using namespace atirma;
using namespace atirma::simulator;

namespace {

const std::vector<waypoint> before{{28.1530, -15.4480}, {28.1600, -15.4520}, {28.1545, -15.4580}};
const std::vector<waypoint> after{{28.1600, -15.4600}, {28.1680, -15.4560}, {28.1640, -15.4690}, {28.1650, -15.47}};

std::uint32_t last_id = 0;

ise::bytes packet(const simulated_boat& boat, boat_command what) {
    telecommand made;
    made.id = ++last_id;
    made.sent_at = boat.clock_now();
    made.valid_for = 10min;
    made.command = std::move(what);
    return encode_telecommand(made);
}

std::vector<ise::bytes> upload(const simulated_boat& boat, const std::vector<waypoint>& list) {
    std::vector<ise::bytes> all;
    for (std::size_t i = 0; i < list.size(); ++i)
        all.push_back(packet(boat, commands::mission_stage{static_cast<std::uint8_t>(i), list[i]}));
    all.push_back(
        packet(boat, commands::mission_switch{static_cast<std::uint8_t>(list.size()), mission_checksum(list)}));
    return all;
}

ack_code tell(simulated_boat& boat, const ise::bytes& raw) { return boat.on_packet(link_id::xbee, raw)->code; }

bool is(const std::vector<waypoint>& here, const std::vector<waypoint>& list) {
    return mission_checksum(here) == mission_checksum(list) && here.size() == list.size();
}

simulated_boat sailing() {
    boat_options options;
    options.course = before;
    return {options, constant_wind({6, 40})};
}

} // namespace

TEST_CASE("missions: the checksum is CRC-32 of the places on air, the same before and after the air") {
    CHECK(mission_checksum({}) == 0);
    auto boat = sailing();
    for (const auto& raw : upload(boat, after)) CHECK(tell(boat, raw) == ack_code::done);
    CHECK(is(boat.pilot().list(), after));
    CHECK(boat.pilot().active() == 0);
    auto parsed = parse_telecommand(packet(boat, commands::mission_stage{0, {28.16, -15.452}})).value();
    const waypoint sent[] = {{28.16, -15.452}};
    const waypoint came[] = {parsed.command.get_if<commands::mission_stage>()->point};
    CHECK(mission_checksum(sent) == mission_checksum(came));
    // zlib.crc32(struct.pack("<ii", 281600000, -154520000))
    CHECK(mission_checksum(sent) == 0x25E0DBD7u);
}

TEST_CASE("missions: a link that dies after any packet leaves the old list or the new one") {
    for (std::size_t arrive = 0; arrive <= after.size() + 1; ++arrive) {
        auto boat = sailing();
        auto all = upload(boat, after);
        for (std::size_t i = 0; i < arrive; ++i) tell(boat, all[i]);
        boat.advance(1min); // it sails what it has
        CHECK(is(boat.pilot().list(), arrive == all.size() ? after : before));
        CHECK(boat.pilot().mode() == sailing_mode::automatic);
        CHECK(boat.pilot().has_target());
    }
}

TEST_CASE("missions: whatever is lost, doubled, overtaken or mixed of two uploads, a list is whole") {
    const std::vector<waypoint> other{{28.10, -15.40}, {28.11, -15.41}};
    std::mt19937 dice(11);
    std::size_t changed = 0;
    for (int round = 0; round < 400; ++round) {
        auto boat = sailing();
        auto all = upload(boat, after);
        for (auto& raw : upload(boat, other)) all.push_back(raw);
        auto doubled = all;
        all.insert(all.end(), doubled.begin(), doubled.end());
        std::shuffle(all.begin(), all.end(), dice);
        all.resize(dice() % (all.size() + 1));
        for (const auto& raw : all) {
            tell(boat, raw);
            const auto& now = boat.pilot().list();
            REQUIRE((is(now, before) || is(now, after) || is(now, other)));
        }
        if (!is(boat.pilot().list(), before)) ++changed;
    }
    CHECK(changed > 20);
    CHECK(changed < 380);
}

TEST_CASE("missions: a switch to what is not there is refused with what is missing, and the list stays") {
    auto boat = sailing();
    auto all = upload(boat, after);
    auto no = boat.on_packet(link_id::xbee, all.back()).value();
    CHECK(no.code == ack_code::refused);
    CHECK(no.text == "waypoint 1 of 4 is not staged");
    CHECK(is(boat.pilot().list(), before));
    for (std::size_t i = 0; i + 1 < all.size(); ++i) tell(boat, all[i]);
    tell(boat, packet(boat, commands::mission_stage{1, {28.2, -15.5}})); // somebody else's
    no = boat.on_packet(link_id::xbee, packet(boat, commands::mission_switch{4, mission_checksum(after)})).value();
    CHECK(no.text == "the staged list is another one");
    CHECK(is(boat.pilot().list(), before));
    CHECK(tell(boat, packet(boat, commands::mission_stage{100, {28.2, -15.5}})) == ack_code::bad_argument);
    CHECK(tell(boat, packet(boat, commands::mission_switch{200, 0})) == ack_code::bad_argument);
    tell(boat, packet(boat, commands::mission_stage{1, after[1]}));
    tell(boat, packet(boat, commands::reboot())); // what was staged is lost with it
    boat.advance(20s);
    no = boat.on_packet(link_id::xbee, packet(boat, commands::mission_switch{4, mission_checksum(after)})).value();
    CHECK(no.text == "waypoint 1 of 4 is not staged");
    CHECK(is(boat.pilot().list(), before));
    CHECK(tell(boat, packet(boat, commands::mission_switch{0, 0})) == ack_code::done); // no list is one, too
    CHECK(boat.pilot().list().empty());
}

} // namespace missions_test
