#include "air.hpp"
#include "hex.hpp"

#include <support/catch.hpp>

#include <set>

namespace client_test {

using namespace atirma::xbee;
using namespace std::chrono_literals;

TEST_CASE("a client finds the modem's API mode, also of one left in transparent mode") {
    for (auto ap : std::initializer_list<std::uint8_t>{1, 2, 0}) {
        CAPTURE(static_cast<int>(ap));
        air sky;
        auto& s = sky.add(1, 0, ap);
        sky.run(20s);
        REQUIRE(s.all<radio_ready>().size() == 1);
        CHECK(s.client.mode() == (ap == 2 ? api_mode::escaped : api_mode::plain));
    }
}

TEST_CASE("a line without a modem is reported once and tried on") {
    air sky;
    auto& s = sky.add(1, 0);
    s.plugged = false;
    auto id = s.client.send(sky.now, 2, hex("01"), 0, 5s);
    REQUIRE(id);
    sky.run(60s);
    CHECK(s.all<radio_silent>().size() == 1);
    REQUIRE(s.all<send_outcome>().size() == 1);
    CHECK(s.all<send_outcome>()[0].executed == ise::execution::not_executed);
    s.plugged = true;
    sky.run(80s);
    CHECK(s.client.ready());
}

TEST_CASE("packets pass between modems of different API modes and each is told as delivered") {
    air sky;
    auto& a = sky.add(0x11, 0, 1);
    auto& b = sky.add(0x7E, 800, 2);
    sky.run(2s);
    std::vector<token> sent;
    for (int i = 0; i < 20; ++i)
        sent.push_back(a.client.send(sky.now, 0x7E, ise::bytes(static_cast<std::size_t>(i), std::byte{0x7E})).value());
    sky.run(30s);
    auto outcomes = a.all<send_outcome>();
    REQUIRE(outcomes.size() == 20);
    for (std::size_t i = 0; i < 20; ++i) {
        CHECK(outcomes[i].id == sent[i]);
        CHECK(outcomes[i].delivered);
    }
    auto got = b.all<packet_received>();
    REQUIRE(got.size() == 20);
    for (std::size_t i = 0; i < 20; ++i) CHECK(got[i].payload.size() == i);
    CHECK(got[0].source == 0x11);
}

TEST_CASE("losses cost retries, duplicates are filtered, and out of reach ends without an acknowledgement") {
    ether_options lossy;
    lossy.extra_loss = 0.4;
    lossy.seed = 4;
    air sky(lossy);
    auto& a = sky.add(1, 0);
    auto& b = sky.add(2, 500);
    sky.add(3, 90000);
    sky.run(5s);
    for (int i = 0; i < 50; ++i) a.client.send(sky.now, 2, {std::byte{static_cast<std::uint8_t>(i)}}).value();
    sky.run(60s);
    auto outcomes = a.all<send_outcome>();
    REQUIRE(outcomes.size() == 50);
    int retries = 0;
    for (auto& o : outcomes) retries += o.retries;
    CHECK(retries > 20);
    auto got = b.all<packet_received>();
    // In order, none twice.
    for (std::size_t i = 1; i < got.size(); ++i) CHECK(got[i].payload[0] > got[i - 1].payload[0]);
    CHECK(got.size() >= 49);
    a.events.clear();
    a.client.send(sky.now, 3, hex("01")).value();
    sky.run(70s);
    auto far = a.all<send_outcome>();
    REQUIRE(far.size() == 1);
    CHECK(far[0].code == delivery::no_ack);
    CHECK(far[0].executed == ise::execution::unknown);
    CHECK_FALSE(far[0].reason.empty());
}

TEST_CASE("a broadcast reaches everyone once") {
    air sky;
    auto& a = sky.add(1, 0);
    auto& b = sky.add(2, 500);
    auto& c = sky.add(3, 600);
    sky.run(2s);
    a.client.send(sky.now, broadcast_address, hex("AA")).value();
    sky.run(4s);
    for (auto* s : {&b, &c}) {
        REQUIRE(s->all<packet_received>().size() == 1);
        CHECK(s->all<packet_received>()[0].broadcast);
    }
    CHECK(a.all<send_outcome>().at(0).delivered);
}

TEST_CASE("local and remote AT commands are answered, or their time runs out") {
    air sky;
    auto& a = sky.add(1, 0);
    auto& b = sky.add(2, 1000);
    sky.run(2s);
    a.client.send(sky.now, 2, hex("AA")).value();
    sky.run(3s);
    a.client.local_at(sky.now, at("PL"), hex("03")).value();
    a.client.remote_at(sky.now, 2, at("DB")).value();
    a.client.remote_at(sky.now, 2, at("RR"), hex("05")).value();
    a.client.remote_at(sky.now, 99, at("DB")).value();
    a.client.local_at(sky.now, at("ZZ")).value();
    sky.run(30s);
    auto got = a.all<at_outcome>();
    REQUIRE(got.size() == 5);
    auto find = [&](std::uint64_t address, std::string_view name) {
        return *std::find_if(got.begin(), got.end(),
                             [&](auto& o) { return o.address == address && text(o.command) == name; });
    };
    CHECK(find(0, "PL").status == at_status::ok);
    CHECK(find(0, "ZZ").status == at_status::bad_command);
    CHECK(find(2, "RR").status == at_status::ok);
    CHECK(find(99, "DB").status == at_status::tx_failure);
    auto rssi = at_number(find(2, "DB").value).value();
    CHECK(-static_cast<double>(rssi) == Approx(sky.ether.strength_dbm(power_dbm(4), 1000)).margin(15));
    b.client.local_at(sky.now, at("RR")).value();
    sky.run(31s);
    CHECK(b.all<at_outcome>().at(0).value == hex("05"));
}

TEST_CASE("a modem that restarts is found again and what it held is told as unknown") {
    air sky;
    auto& a = sky.add(1, 0);
    sky.add(2, 500);
    sky.run(2s);
    a.client.local_at(sky.now, at("FR")).value();
    sky.exchange();
    a.client.send(sky.now, 2, hex("01")).value();
    sky.run(10s);
    CHECK(a.all<modem_restarted>().size() == 1);
    CHECK(a.all<radio_ready>().size() == 2);
    REQUIRE(a.all<send_outcome>().size() == 1);
    CHECK(a.all<send_outcome>()[0].executed == ise::execution::unknown);
}

TEST_CASE("a modem that falls silent is noticed by its unanswered requests") {
    air sky;
    auto& a = sky.add(1, 0);
    sky.run(2s);
    a.plugged = false;
    for (int i = 0; i < 3; ++i) a.client.local_at(sky.now, at("DB")).value();
    sky.run(20s);
    CHECK(a.all<at_outcome>().size() == 3);
    CHECK(a.all<radio_silent>().size() == 1);
    a.plugged = true;
    sky.run(40s);
    CHECK(a.client.ready());
}

TEST_CASE("transmissions that the modem turns away are tried again after a pause") {
    air sky;
    auto& a = sky.add(1, 0);
    sky.add(2, 100);
    a.device->set_temperature(70); // 0.1 s in a second
    sky.run(2s);
    for (int i = 0; i < 12; ++i) a.client.send(sky.now, 2, ise::bytes(100), option_purge_if_delayed).value();
    sky.run(50s);
    auto got = a.all<send_outcome>();
    REQUIRE(got.size() == 12);
    CHECK(std::all_of(got.begin(), got.end(), [](auto& o) { return o.delivered; }));
    CHECK(a.client.counters().delayed > 0);
    CHECK(sky.stations[1]->all<packet_received>().size() == 12);
}

TEST_CASE("a full queue and a payload too large are refused, stopping ends every request") {
    air sky;
    client_options small;
    small.max_queued = 3;
    auto& a = sky.add(1, 0, 1, small);
    CHECK(a.client.send(sky.now, 2, ise::bytes(101)).error().code() == ise::errc::too_large);
    for (int i = 0; i < 3; ++i) CHECK(a.client.send(sky.now, 2, hex("01")));
    CHECK(a.client.send(sky.now, 2, hex("01")).error().code() == ise::errc::overloaded);
    a.client.stop(sky.now, "the port vanished");
    sky.exchange();
    auto got = a.all<send_outcome>();
    REQUIRE(got.size() == 3);
    CHECK(got[0].reason == "the port vanished");
    CHECK(a.client.next_event() == never);
    a.client.start(sky.now);
    sky.run(5s);
    CHECK(a.client.ready());
}

TEST_CASE("a transmission counts as not executed only where the modem has certainly not sent it") {
    auto executed_with = [](std::uint8_t code) {
        radio_client client{client_options{}};
        auto written = [&client] {
            frame_decoder decoder(api_mode::plain);
            decoder.push(client.take_output());
            return std::get<frame>(decoder.next().value());
        };
        client.start(0s);
        auto asked = std::get<at_request>(written());
        client.on_bytes(0s, encode(at_response{asked.frame_id, at("AP"), at_status::ok, hex("01")}, api_mode::plain));
        client.send(0s, 2, hex("01"), 0, 100ms).value(); // too short for another attempt
        auto sent = std::get<transmit_request>(written());
        client.on_bytes(0s, encode(transmit_status{sent.frame_id, unknown_network, 0, static_cast<delivery>(code), 0},
                                   api_mode::plain));
        while (auto event = client.take_event())
            if (auto* outcome = std::get_if<send_outcome>(&*event)) return outcome->executed;
        FAIL("no outcome");
        return ise::execution::unknown;
    };
    const std::set<int> not_sent{0x02, 0x03, 0x15, 0x22, 0x23, 0x24, 0x25, 0x32, 0x74};
    for (int code = 0; code < 256; ++code) {
        CAPTURE(code);
        auto expected = not_sent.contains(code) ? ise::execution::not_executed : ise::execution::unknown;
        CHECK(executed_with(static_cast<std::uint8_t>(code)) == expected);
    }
}

TEST_CASE("garbage between frames is skipped and counted") {
    air sky;
    auto& a = sky.add(1, 0);
    sky.run(2s);
    a.client.on_bytes(sky.now, hex("00FF7E0005 7E7E"));
    sky.run(5s);
    a.client.local_at(sky.now, at("PL")).value();
    sky.run(7s);
    REQUIRE(a.all<at_outcome>().size() == 1);
    CHECK(a.all<at_outcome>()[0].status == at_status::ok);
    CHECK(a.client.counters().refused_frames > 0);
}

TEST_CASE("the same seed gives the same air, another seed another") {
    auto run = [](std::uint64_t seed) {
        ether_options options;
        options.seed = seed;
        options.extra_loss = 0.5;
        air sky(options);
        auto& a = sky.add(1, 0);
        sky.add(2, 3000);
        sky.run(2s);
        for (int i = 0; i < 40; ++i) a.client.send(sky.now, 2, hex("0102")).value();
        sky.run(60s);
        std::vector<int> retries;
        for (auto& o : a.all<send_outcome>()) retries.push_back(o.retries);
        return retries;
    };
    CHECK(run(1) == run(1));
    CHECK(run(1) != run(2));
}

TEST_CASE("strength falls with distance until nothing arrives") {
    for (double distance : {500.0, 2000.0}) {
        air sky;
        auto& a = sky.add(1, 0);
        sky.add(2, distance);
        sky.run(2s);
        a.client.send(sky.now, 2, hex("01")).value();
        sky.run(10s);
        CHECK(a.all<send_outcome>().at(0).delivered);
    }
    ether quiet;
    CHECK(quiet.strength_dbm(25, 100) > quiet.strength_dbm(25, 1000));
    CHECK(quiet.strength_dbm(25, 60000) < -125);
}

TEST_CASE("hidden senders collide, and the receiver counts the damage") {
    air sky;
    auto& a = sky.add(1, -6000);
    auto& b = sky.add(2, 6000); // out of each other's hearing, both near the limit of the middle one
    auto& middle = sky.add(3, 0);
    sky.run(2s);
    for (int i = 0; i < 10; ++i) {
        a.client.send(sky.now, 3, ise::bytes(80)).value();
        b.client.send(sky.now, 3, ise::bytes(80)).value();
    }
    sky.run(60s);
    CHECK(sky.ether.collided() > 0);
    CHECK(a.all<send_outcome>().size() == 10);
    CHECK(b.all<send_outcome>().size() == 10);
    CHECK(middle.all<packet_received>().size() > 0);
}

} // namespace client_test
