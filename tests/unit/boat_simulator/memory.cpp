#include <components/boat_simulator/boat_memory.hpp>

#include <ise/packet/codec.hpp>

#include <support/catch.hpp>

#include <array>

namespace memory_test {

using namespace atirma;
using namespace atirma::simulator;
using namespace std::chrono_literals;

namespace {

simulated_boat sailed_for(std::chrono::seconds time, boat_options options) {
    simulated_boat boat(std::move(options), constant_wind({6, 45}));
    boat.advance(time);
    return boat;
}

boat_options on_t1() {
    boat_options options;
    options.course = find_course("T1")->marks;
    options.epoch = utc_time(1'500'000'000'000ms);
    options.boot = 41;
    return options;
}

telecommand command(std::uint32_t id, boat_command what) {
    telecommand made;
    made.id = id;
    made.command = std::move(what);
    return made;
}

} // namespace

TEST_CASE("a boat that lost its power goes on where it was, in its next boot, with its list, its epoch and what it has "
          "done") {
    auto boat = sailed_for(600s, on_t1());
    auto clear = command(1, commands::waypoint_clear());
    clear.authority = 4;
    boat.execute(clear);
    auto add = command(2, commands::waypoint_add{{28.1600, -15.4600}});
    add.authority = 4;
    boat.execute(add);
    auto tack_time = command(3, commands::set_parameter{parameter_id::time_to_next_tack, 240});
    tack_time.authority = 4;
    boat.execute(tack_time);

    boat_options again;
    again.resumed = boat.remember();
    again.executed.assign(boat.executed().begin(), boat.executed().end());
    again.epoch = utc_time(1'500'000'000'000ms);
    auto next = sailed_for(0s, again);
    CHECK(next.boot() == 42);
    CHECK(next.authority() == 4);
    CHECK(next.location_now().latitude_deg == Approx(boat.location_now().latitude_deg).margin(1e-7));
    CHECK(next.location_now().longitude_deg == Approx(boat.location_now().longitude_deg).margin(1e-7));
    CHECK(next.location_now().distance_sailed_m == Approx(boat.location_now().distance_sailed_m));
    REQUIRE(next.pilot().list().size() == 1);
    CHECK(next.pilot().list()[0].latitude_deg == 28.1600);
    CHECK(next.pilot().parameter(parameter_id::time_to_next_tack) == 240);
    CHECK(next.pilot().mode() == sailing_mode::automatic);
    // A telecommand that it did in its life before is answered, and changes nothing.
    CHECK(next.execute(clear).code == ack_code::done);
    CHECK(next.pilot().list().size() == 1);
    // One under a lower epoch is refused, as before.
    auto old = command(9, commands::waypoint_clear());
    old.authority = 2;
    CHECK(next.execute(old).code == ack_code::no_authority);
}

TEST_CASE("a boat that lost its power keeps the periods that telecommands have set, and no others") {
    auto boat = sailed_for(10s, on_t1()); // without GPRS and Iridium
    CHECK(boat.execute(command(1, commands::set_telemetry_period{link_id::gprs, 30})).code == ack_code::done);
    auto again = on_t1();
    again.resumed = boat.remember();
    again.telemetry_period_s = {2, 5, 600};
    auto next = sailed_for(0s, again);
    CHECK(next.telemetry_period_s(link_id::xbee) == 2);
    CHECK(next.telemetry_period_s(link_id::iridium) == 600);
    CHECK(next.telemetry_period_s(link_id::gprs) == 30);
    next.execute(command(2, commands::set_parameter{parameter_id::telemetry_period, 4}));
    next.execute(command(3, commands::set_telemetry_period{link_id::gprs, 0}));
    again.resumed = next.remember();
    auto third = sailed_for(0s, again);
    CHECK(third.telemetry_period_s(link_id::xbee) == 4);
    CHECK(third.telemetry_period_s(link_id::iridium) == 600);
    CHECK(third.telemetry_period_s(link_id::gprs) == 0);
}

TEST_CASE("a forged epoch is not kept over the loss of power, and the boat obeys the operators ashore afterwards") {
    auto keeper = ise::database::open("memory:boat-epoch", {}).value(); // the file, over the boat's lives
    {
        auto boat = sailed_for(10s, on_t1());
        auto ping = command(1, commands::ping());
        ping.authority = 4;
        boat.execute(ping);
        ping.id = 2;
        ping.authority = 0xFFFFFFFF;
        boat.execute(ping);
        boat_memory::open("memory:boat-epoch").value().keep(boat.remember(), {}).value();
    }
    auto options = on_t1();
    options.resumed = boat_memory::open("memory:boat-epoch").value().last().value();
    auto boat = sailed_for(0s, options);
    CHECK(boat.authority() == 4);
    auto clear = command(3, commands::waypoint_clear());
    clear.authority = 4;
    CHECK(boat.execute(clear).code == ack_code::done);
}

TEST_CASE("a boat's memory gives back what was put there, and the packets without acknowledgement under new numbers") {
    auto keeper = ise::database::open("memory:boat-memory", {}).value(); // the file, over the boat's lives
    auto boat = sailed_for(60s, on_t1());
    auto ack = boat.execute(command(5, commands::ping()));
    std::vector<ise::bytes> packets = boat.take_packets(link_id::xbee);
    REQUIRE(packets.size() > 4);
    {
        auto memory = boat_memory::open("memory:boat-memory").value();
        CHECK_FALSE(memory.last().value());
        CHECK(memory.take_unacknowledged().value().empty());
        memory.keep(boat.remember(), std::span(&ack, 1)).value();
        memory.keep(boat.remember(), std::span(&ack, 1)).value(); // the same one again
        for (std::uint32_t i = 0; i < 4; ++i) memory.put(i + 1, packets[i]).value();
        memory.forget(2).value();
    }
    for (int life = 0; life < 2; ++life) { // nothing is lost by reading
        auto memory = boat_memory::open("memory:boat-memory").value();
        auto last = memory.last().value();
        REQUIRE(last);
        CHECK(last->boot == 41);
        CHECK(last->list.size() == 3);
        auto executed = memory.executed().value();
        REQUIRE(executed.size() == 1);
        CHECK(executed[0].id == 5);
        CHECK(memory.take_unacknowledged().value() == std::vector<ise::bytes>{packets[2], packets[3]});
    }
    auto memory = boat_memory::open("memory:boat-memory").value();
    memory.forget(1).value(); // under the new numbers
    CHECK(memory.take_unacknowledged().value() == std::vector<ise::bytes>{packets[3]});
}

TEST_CASE("a boat's memory from before only commanded periods were stored is read") {
    auto boat = sailed_for(60s, on_t1());
    boat.execute(command(1, commands::set_telemetry_period{link_id::xbee, 7}));
    auto raw = ise::encode(boat.remember());
    raw.resize(raw.size() - 11); // u8 1 and f64 of the radio, u8 0 twice
    for (double period_s : {7.0, 5.0, 0.0}) {
        auto old = ise::encode(period_s);
        raw.insert(raw.end(), old.begin(), old.end());
    }
    auto keeper = ise::database::open("memory:boat-memory-periods", {}).value();
    boat_memory::open("memory:boat-memory-periods").value().keep(boat.remember(), {}).value();
    keeper.execute("UPDATE boat SET state = ?", {raw}).value();
    auto again = on_t1();
    again.resumed = boat_memory::open("memory:boat-memory-periods").value().last().value();
    REQUIRE(again.resumed);
    CHECK(again.resumed->boot == 41);
    CHECK(again.resumed->list.size() == 3);
    again.telemetry_period_s = {2, 8, 600};
    auto next = sailed_for(0s, again);
    CHECK(next.telemetry_period_s(link_id::xbee) == 7);
    CHECK(next.telemetry_period_s(link_id::iridium) == 600);
    CHECK(next.telemetry_period_s(link_id::gprs) == 8);
}

TEST_CASE("a boat's memory from before there were receipts is read, and has room for packets without one") {
    const std::array<std::string_view, 1> before{
        "CREATE TABLE boat(one INTEGER PRIMARY KEY CHECK(one = 1), state BLOB NOT NULL);"
        "CREATE TABLE executed(number INTEGER PRIMARY KEY AUTOINCREMENT, id INTEGER NOT NULL UNIQUE, raw BLOB NOT "
        "NULL);"
        "CREATE TABLE unacknowledged(number INTEGER PRIMARY KEY, raw BLOB NOT NULL)"};
    auto boat = sailed_for(60s, on_t1());
    auto packets = boat.take_packets(link_id::xbee);
    REQUIRE(packets.size() > 1);
    auto old = ise::database::open("memory:boat-memory-before", before).value();
    old.execute("INSERT INTO boat(one, state) VALUES(1, ?)", {ise::encode(boat.remember())}).value();
    old.execute("INSERT INTO unacknowledged(number, raw) VALUES(7, ?)", {packets[0]}).value();
    auto memory = boat_memory::open("memory:boat-memory-before").value();
    CHECK(memory.last().value()->boot == 41);
    CHECK(memory.take_unacknowledged().value() == std::vector<ise::bytes>{packets[0]});
    CHECK(memory.not_receipted().value().empty());
    memory.put({41, 1}, packets[1]).value();
    CHECK(memory.not_receipted().value() == std::vector<ise::bytes>{packets[1]});
}

} // namespace memory_test
