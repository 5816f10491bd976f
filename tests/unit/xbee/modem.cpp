#include "air.hpp"
#include "hex.hpp"

#include <support/catch.hpp>

namespace modem_test {

using namespace atirma::xbee;
using namespace std::chrono_literals;

namespace {

std::vector<frame> frames(modem& m, api_mode mode = api_mode::plain) {
    frame_decoder decoder(mode);
    decoder.push(m.take_serial());
    std::vector<frame> out;
    while (auto got = decoder.next()) out.push_back(std::get<frame>(*got));
    return out;
}

at_response ask(modem& m, instant now, std::string_view command, ise::bytes parameter = {},
                api_mode mode = api_mode::plain) {
    m.take_serial();
    m.on_serial(now, encode(at_request{1, at(command), std::move(parameter), false}, mode));
    auto got = frames(m, mode);
    REQUIRE(got.size() == 1);
    return std::get<at_response>(got[0]);
}

transmit_request packet(std::size_t size, std::uint64_t to, std::uint8_t id = 1, std::uint8_t options = 0) {
    return {id, to, unknown_network, 0, options, ise::bytes(size, std::byte{0x7E})};
}

std::string text(modem& m) { return std::string(ise::as_text(m.take_serial())); }

} // namespace

TEST_CASE("a modem that starts says so, and answers AT commands in its API mode") {
    for (auto mode : {api_mode::plain, api_mode::escaped}) {
        modem_options options;
        options.api_mode = static_cast<std::uint8_t>(mode);
        options.temperature_c = -10;
        modem m(options);
        CHECK(frames(m, mode) == std::vector<frame>{modem_status{0}});
        CHECK(temperature_c(ask(m, 1s, "TP", {}, mode).value) == -10);
        CHECK(ask(m, 1s, "NP", {}, mode).value == hex("0100"));
        CHECK(ask(m, 1s, "RR", {}, mode).value == hex("0A"));
        CHECK(ask(m, 1s, "DC", {}, mode).value == hex("00"));
        CHECK(ask(m, 1s, "SH", {}, mode).value == hex("0013A200"));
        CHECK(ask(m, 1s, "PL", hex("05"), mode).status == at_status::bad_parameter);
        CHECK(ask(m, 1s, "PL", hex("02"), mode).status == at_status::ok);
        CHECK(ask(m, 1s, "PL", {}, mode).value == hex("02"));
        CHECK(ask(m, 1s, "ZZ", {}, mode).status == at_status::bad_command);
        CHECK(ask(m, 1s, "TP", hex("01"), mode).status == at_status::bad_parameter);
    }
}

TEST_CASE("a queued command waits for AC, and a change of AP is answered in the old mode") {
    modem m({});
    m.take_serial();
    m.on_serial(1s, encode(at_request{3, at("RR"), hex("02"), true}, api_mode::plain));
    CHECK(std::get<at_response>(frames(m)[0]).status == at_status::ok);
    m.on_serial(1s, encode(at_request{0, at("RR"), {}, true}, api_mode::plain));
    CHECK(ask(m, 1s, "AC").status == at_status::ok);
    CHECK(ask(m, 1s, "RR").value == hex("02"));
    CHECK(ask(m, 1s, "AP", hex("02")).status == at_status::ok);
    CHECK(ask(m, 1s, "AP", {}, api_mode::escaped).value == hex("02"));
}

TEST_CASE("a modem reads frames as it writes them, whichever way its API mode was changed") {
    auto reads_escaped = [](modem& m, instant now) { // 7E within the frame is escaped
        auto got = ask(m, now, "NI", hex("7E7D11"), api_mode::escaped);
        return got.status == at_status::ok && ask(m, now, "NI", {}, api_mode::escaped).value == hex("7E7D11");
    };
    SECTION("in command mode") {
        modem m({});
        m.take_serial();
        m.on_serial(5s, ise::as_bytes("+++"));
        m.advance(7s);
        m.on_serial(7s, ise::as_bytes("ATAP2\rATCN\r"));
        CHECK(text(m) == "OK\rOK\rOK\r");
        CHECK(reads_escaped(m, 8s));
    }
    SECTION("by a queued command") {
        modem m({});
        m.take_serial();
        m.on_serial(1s, encode(at_request{3, at("AP"), hex("02"), true}, api_mode::plain));
        CHECK(std::get<at_response>(frames(m)[0]).status == at_status::ok);
        CHECK(ask(m, 1s, "AC").status == at_status::ok); // answered in the old mode
        CHECK(reads_escaped(m, 1s));
    }
    SECTION("by a queued command, with the next request") {
        modem m({});
        m.take_serial();
        m.on_serial(1s, encode(at_request{3, at("AP"), hex("02"), true}, api_mode::plain));
        m.take_serial();
        CHECK(ask(m, 1s, "PL").status == at_status::ok);
        CHECK(reads_escaped(m, 1s));
    }
    SECTION("by a remote modem") {
        modem m({});
        m.take_serial();
        m.on_air(1s, radio_packet{7, m.address(), m.network(), 1, radio_kind::remote_at, hex("0100415002")}, -71);
        m.advance(2s);
        m.take_serial();
        CHECK(reads_escaped(m, 3s));
    }
}

TEST_CASE("+++ between silences opens command mode, which reads DB as text") {
    modem m({});
    m.take_serial();
    m.on_air(1s, radio_packet{7, m.address(), m.network(), 1, radio_kind::data, hex("00")}, -71);
    m.take_serial();
    m.on_serial(5s, ise::as_bytes("+++"));
    CHECK(text(m).empty());
    m.advance(7s);
    CHECK(text(m) == "OK\r");
    m.on_serial(7s, ise::as_bytes("at"));
    m.on_serial(7s, ise::as_bytes("db\r"));
    CHECK(text(m) == "47\r");
    m.on_serial(7s, ise::as_bytes("atpl3\ratpl\ratzz\r"));
    CHECK(text(m) == "OK\r3\rERROR\r");
    m.on_serial(7s, ise::as_bytes("atcn\r"));
    CHECK(text(m) == "OK\r");
    CHECK(ask(m, 8s, "PL").value == hex("03"));
    m.on_serial(8s + 10ms, ise::as_bytes("+++")); // no silence before it
    m.advance(20s);
    CHECK(text(m).empty());
}

TEST_CASE("command mode ends by itself") {
    modem m({});
    m.take_serial();
    m.on_serial(5s, ise::as_bytes("+++"));
    m.advance(6s);
    CHECK(text(m) == "OK\r");
    m.advance(17s);
    CHECK(ask(m, 17s, "PL").status == at_status::ok);
}

TEST_CASE("what cannot be sent is refused at once") {
    modem m({});
    m.take_serial();
    auto status = [&](const frame& f) {
        m.on_serial(1s, encode(f, api_mode::plain));
        return std::get<transmit_status>(frames(m).at(0)).outcome;
    };
    CHECK(status(packet(101, 7)) == delivery::payload_too_large);
    CHECK(status(packet(1, m.address())) == delivery::self_addressed);
    for (std::size_t i = 0; i < modem::max_queued; ++i) m.on_serial(1s, encode(packet(1, 7), api_mode::plain));
    CHECK(status(packet(1, 7, 9)) == delivery::resource_error);
    CHECK_FALSE(m.clear_to_send());
}

TEST_CASE("without an answer from the air a packet is tried RR more times and reported") {
    modem m({});
    ask(m, 0s, "RR", hex("03"));
    m.on_serial(1s, encode(packet(50, 7), api_mode::plain));
    std::size_t attempts = 0;
    while (m.next_event() != never) {
        m.advance(m.next_event());
        attempts += m.take_transmissions().size();
    }
    CHECK(attempts == 4);
    auto got = frames(m);
    REQUIRE(got.size() == 1);
    CHECK(std::get<transmit_status>(got[0]).outcome == delivery::no_ack);
    CHECK(std::get<transmit_status>(got[0]).retries == 3);
    CHECK(ask(m, 5s, "TA").value == hex("0004"));
    CHECK(ask(m, 5s, "TR").value == hex("0001"));
    CHECK(m.duty_percent(5s) == Approx(4 * 100 * 8 / 24000.0 / 360 * 100));
}

TEST_CASE("the duty cycle holds the transmitter for the rest of the hour, drops CTS, and purges what asks for it") {
    modem m({});
    ask(m, 0s, "MT", hex("00"));
    instant now = 1s, first = now;
    int sent = 0;
    for (;;) { // broadcasts of 50 ms each
        m.on_serial(now, encode(packet(100, broadcast_address), api_mode::plain));
        if (!m.clear_to_send()) break;
        now = m.next_event();
        m.advance(now);
        sent += static_cast<int>(m.take_transmissions().size());
    }
    CHECK(sent == 7200);
    CHECK(ask(m, now, "DC").value == hex("64"));
    m.on_serial(now, encode(packet(10, broadcast_address, 2, option_purge_if_delayed), api_mode::plain));
    CHECK(m.next_event() == first + 1h);
    m.advance(first + 1h);
    CHECK(m.take_transmissions().size() == 1);
    CHECK(m.clear_to_send());
    m.take_serial();
    m.advance(first + 1h + 50ms);
    auto got = frames(m);
    REQUIRE(got.size() >= 1);
    CHECK(std::get<transmit_status>(got[0]).outcome == delivery::success);
}

TEST_CASE("a packet that may be purged is, when the duty cycle is used up") {
    modem m({});
    m.set_temperature(70); // hot: 0.1 s in a second
    ask(m, 0s, "MT", hex("00"));
    for (std::uint8_t id = 1; id <= 3; ++id)
        m.on_serial(1s, encode(packet(100, broadcast_address, id, option_purge_if_delayed), api_mode::plain));
    m.advance(1s + 500ms);
    CHECK(m.take_transmissions().size() == 2);
    auto got = frames(m);
    REQUIRE(got.size() == 3);
    CHECK(std::get<transmit_status>(got[2]).outcome == delivery::purged);
    m.on_serial(1s + 500ms, encode(packet(100, broadcast_address, 4), api_mode::plain));
    CHECK_FALSE(m.clear_to_send());
    CHECK(m.next_event() == 2s);
}

TEST_CASE("a busy channel ends in a CCA failure") {
    modem m({});
    m.take_serial();
    m.on_serial(1s, encode(packet(10, 7), api_mode::plain));
    m.take_transmissions();
    modem other({});
    other.take_serial();
    other.on_carrier(1h);
    other.on_serial(1s, encode(packet(10, 7), api_mode::plain));
    CHECK(other.take_transmissions().empty());
    for (int i = 0; i < 50 && other.next_event() != never; ++i) {
        other.on_carrier(other.next_event() + 1h);
        other.advance(other.next_event());
    }
    auto got = frames(other);
    REQUIRE(got.size() == 1);
    CHECK(std::get<transmit_status>(got[0]).outcome == delivery::cca_failure);
}

TEST_CASE("a packet heard twice is acknowledged twice and delivered once") {
    modem m({});
    m.take_serial();
    radio_packet p{7, m.address(), m.network(), 42, radio_kind::data, hex("AABB")};
    m.on_air(1s, p, -80);
    m.on_air(2s, p, -80);
    CHECK(m.take_transmissions().size() == 2);
    CHECK(frames(m) == std::vector<frame>{received_packet{7, unknown_network, 1, hex("AABB")}});
    p.network = 99;
    p.sequence = 43;
    m.on_air(3s, p, -80);
    CHECK(frames(m).empty());
}

TEST_CASE("FR restarts the modem, which says so when it is back") {
    modem m({});
    CHECK(ask(m, 1s, "FR").status == at_status::ok);
    m.on_serial(1s + 10ms, encode(at_request{1, at("PL"), {}, false}, api_mode::plain)); // deaf
    m.advance(2s);
    CHECK(frames(m) == std::vector<frame>{modem_status{1}});
}

TEST_CASE("garbage on the serial line neither stops nor grows the modem") {
    modem m({});
    m.take_serial();
    atirma::random_source random(5);
    for (int i = 0; i < 2000; ++i) {
        ise::bytes piece;
        for (std::uint64_t n = random.next() % 50; n-- > 0;)
            piece.push_back(static_cast<std::byte>(random.next() % 4 == 0 ? 0x7E : random.next()));
        m.on_serial(i * 1ms, piece);
    }
    m.on_serial(3s, ise::bytes(max_frame_data + 8)); // ends whatever false frame is open
    CHECK(ask(m, 3s, "PL").value == hex("04"));
}

} // namespace modem_test
