#include <components/iridium/sbd_client.hpp>
#include <components/iridium_modem/modem_9602.hpp>

#include <support/catch.hpp>

#include <functional>

namespace client_test {

using namespace atirma;
using namespace atirma::iridium;
using namespace std::chrono_literals;

namespace {

ise::bytes bytes_of(std::string_view text) {
    auto raw = ise::as_bytes(text);
    return {raw.begin(), raw.end()};
}

/// Host and modem at one line, on a clock of their own; each session takes eight seconds and is answered by `radio`.
struct pair_on_a_line {
    explicit pair_on_a_line(sbd_client_options options = {}) : client(options) {}

    modem_9602 modem{"300234010753370"};
    sbd_client client;
    ise::time_point now{1h};
    bool connected = true;
    std::vector<sbd_event> events;
    std::vector<modem_9602::session> sessions;
    std::function<std::pair<sbdix, ise::bytes>(const modem_9602::session&)> radio = [](const auto&) {
        return std::pair(sbdix{}, ise::bytes());
    };
    std::optional<std::pair<ise::time_point, modem_9602::session>> on_air;

    void exchange() {
        for (bool more = true; more;) {
            auto to_modem = client.take_output();
            if (connected && !to_modem.empty()) modem.on_serial(now, to_modem);
            if (auto wanted = modem.take_session()) on_air.emplace(now + 8s, std::move(*wanted));
            auto to_host = modem.take_serial();
            // In pieces of three, as serial lines give them.
            for (std::size_t at = 0; connected && at < to_host.size(); at += 3)
                client.on_bytes(now,
                                ise::bytes_view(to_host).subspan(at, std::min<std::size_t>(3, to_host.size() - at)));
            while (auto event = client.take_event()) events.push_back(*event);
            more = !to_modem.empty() || !to_host.empty();
        }
    }
    void run(ise::duration length) {
        auto end = now + length;
        exchange();
        for (;;) {
            auto next = std::min(client.next_event(), modem.next_event());
            if (on_air) next = std::min(next, on_air->first);
            if (next > end) break;
            now = std::max(now, next);
            if (on_air && on_air->first <= now) {
                auto session = std::move(on_air->second);
                on_air.reset();
                auto [status, message] = radio(session);
                sessions.push_back(session);
                modem.end_session(status, message);
            }
            modem.on_time(now);
            client.on_time(now);
            exchange();
        }
        now = end;
    }
    template <class E>
    std::vector<E> all() const {
        std::vector<E> found;
        for (const auto& event : events)
            if (const auto* one = std::get_if<E>(&event)) found.push_back(*one);
        return found;
    }
};

std::pair<sbdix, ise::bytes> status(int mo) {
    sbdix result;
    result.mo_status = mo;
    result.mt_status = mo > 4 ? 2 : 0;
    return {result, {}};
}

} // namespace

TEST_CASE("iridium: a message goes through one session, whatever its bytes are") {
    pair_on_a_line it;
    it.client.start(it.now);
    it.run(1s);
    REQUIRE(it.all<sbd_ready>().size() == 1);
    CHECK(it.all<sbd_ready>()[0].imei == "300234010753370");
    ise::bytes message;
    for (int i = 0; i < 340; ++i) message.push_back(static_cast<std::byte>(i));
    REQUIRE(it.client.send(it.now, message));
    CHECK(it.client.send(it.now, message).error().code() == ise::errc::overloaded);
    it.run(20s);
    REQUIRE(it.sessions.size() == 1);
    CHECK(it.sessions[0].message == message);
    CHECK(it.all<sbd_sent>().size() == 1);
    CHECK_FALSE(it.client.has_message());
    REQUIRE(it.client.send(it.now, bytes_of("next")));
    it.run(20s);
    REQUIRE(it.sessions.size() == 2);
    CHECK(it.sessions[1].momsn == it.sessions[0].momsn + 1);
    CHECK(it.client.send(it.now, ise::bytes(341)).error().code() == ise::errc::too_large);
    CHECK(it.client.send(it.now, {}).error().code() == ise::errc::invalid_argument);
}

TEST_CASE("iridium: a session that fails is tried again after 10 to 30 s, for 300 s") {
    pair_on_a_line it;
    it.radio = [](const auto&) { return status(32); };
    it.client.start(it.now);
    REQUIRE(it.client.send(it.now, bytes_of("x")));
    it.run(1000s);
    auto lost = it.all<sbd_gave_up>();
    REQUIRE(lost.size() == 1);
    CHECK(lost[0].message);
    CHECK(lost[0].reason.find("no network service") != std::string::npos);
    CHECK(it.sessions.size() >= 300 / 38);
    CHECK(it.sessions.size() <= 300 / 18 + 1);
    CHECK(it.sessions.front().momsn == it.sessions.back().momsn); // it was never sent
    // The next one is another matter.
    it.radio = [](const auto&) { return status(0); };
    REQUIRE(it.client.send(it.now, bytes_of("y")));
    it.run(20s);
    CHECK(it.all<sbd_sent>().size() == 1);
}

TEST_CASE("iridium: after status 36 the modem is left alone for three minutes") {
    pair_on_a_line it;
    it.radio = [&](const auto&) { return status(it.sessions.empty() ? 36 : 0); };
    it.client.start(it.now);
    REQUIRE(it.client.send(it.now, bytes_of("x")));
    it.run(185s);
    CHECK(it.sessions.size() == 1);
    it.run(20s);
    CHECK(it.sessions.size() == 2);
    CHECK(it.all<sbd_sent>().size() == 1);
}

TEST_CASE("iridium: what waits at the gateway is fetched, session by session, and confirmed with the next one") {
    pair_on_a_line it;
    std::vector<std::string> waiting{"first", "OK\r\n", "third"};
    std::vector<std::uint16_t> confirmed;
    std::size_t given = 0;
    it.radio = [&](const modem_9602::session& s) {
        confirmed.push_back(s.received_mtmsn);
        sbdix result;
        if (given == waiting.size()) return std::pair(result, ise::bytes());
        result.mt_status = 1;
        result.mtmsn = static_cast<int>(100 + given);
        result.mt_queued = static_cast<int>(waiting.size() - given - 1);
        return std::pair(result, bytes_of(waiting[given++]));
    };
    it.client.start(it.now);
    REQUIRE(it.client.send(it.now, bytes_of("telemetry")));
    it.run(60s);
    auto got = it.all<sbd_received>();
    REQUIRE(got.size() == 3);
    for (std::size_t i = 0; i < 3; ++i) {
        CHECK(ise::as_text(got[i].data) == waiting[i]);
        CHECK(got[i].mtmsn == 100 + i);
    }
    CHECK(it.sessions[0].message == bytes_of("telemetry"));
    CHECK(it.sessions[1].message.empty()); // sent once only
    CHECK(confirmed == std::vector<std::uint16_t>{0, 100, 101});
}

TEST_CASE("iridium: the modem rings, and the host looks for mail") {
    pair_on_a_line it;
    it.client.start(it.now);
    it.run(5s);
    it.modem.ring();
    it.run(20s);
    REQUIRE(it.sessions.size() == 1);
    CHECK(it.sessions[0].message.empty());
    // It rings in the midst of a session, too: another one follows.
    REQUIRE(it.client.send(it.now, bytes_of("x")));
    it.run(4s);
    it.modem.ring();
    it.run(30s);
    CHECK(it.sessions.size() == 3);
}

TEST_CASE("iridium: a message that is handed over during a look for mail is not taken for sent") {
    pair_on_a_line it;
    it.client.start(it.now);
    it.client.check(it.now);
    it.run(4s);
    REQUIRE(it.client.send(it.now, bytes_of("x")));
    it.run(6s);
    CHECK(it.sessions.size() == 1);
    CHECK(it.all<sbd_sent>().empty());
    it.run(20s);
    REQUIRE(it.sessions.size() == 2);
    CHECK(it.sessions[1].message == bytes_of("x"));
    CHECK(it.all<sbd_sent>().size() == 1);
}

TEST_CASE("iridium: a ring before the message that is fetched is heard") {
    sbd_client client;
    ise::time_point now{1h};
    auto written = [&] { return std::string(ise::as_text(client.take_output())); };
    auto answer = [&](std::string_view text) {
        client.on_bytes(now, ise::as_bytes(text));
        return written();
    };
    client.start(now);
    auto asked = written();
    while (!client.ready()) asked = answer("\r\nOK\r\n");
    client.check(now);
    CHECK(written() == "AT+SBDD0\r");
    CHECK(answer("0\r\n\r\nOK\r\n") == "AT+SBDIX\r");
    CHECK(answer("+SBDIX: 0, 1, 1, 7, 2, 0\r\n\r\nOK\r\n") == "AT+SBDRB\r");
    CHECK(answer("\r\nSBDR").empty());
    CHECK(answer("ING\r\n").empty());
    CHECK(answer(std::string_view("\x00\x02hi\x00\xD1\r\nOK\r\n", 12)) == "AT+SBDD0\r"); // the ring is obeyed
    CHECK(answer("0\r\n\r\nOK\r\n") == "AT+SBDIXA\r");
    std::vector<std::string> got;
    while (auto event = client.take_event())
        if (auto* one = std::get_if<sbd_received>(&*event)) got.emplace_back(ise::as_text(one->data));
    CHECK(got == std::vector<std::string>{"hi"});
}

TEST_CASE("iridium: a modem that answers ERROR to AT is asked again after a pause") {
    sbd_client client;
    ise::time_point now{1h};
    client.start(now);
    std::size_t asked = 0, told = 0;
    for (auto end = now + 60s; now < end;) {
        bool quiet = client.take_output().empty();
        if (!quiet) {
            ++asked;
            client.on_bytes(now, ise::as_bytes("\r\nERROR\r\n"));
            REQUIRE(asked < 100);
        }
        while (auto event = client.take_event()) told += std::holds_alternative<sbd_silent>(*event) ? 1 : 0;
        if (!quiet) continue;
        REQUIRE(client.next_event() > now);
        now = std::min(end, client.next_event());
        client.on_time(now);
    }
    CHECK(asked == 12); // each 5 s
    CHECK(told == 1);
    client.on_bytes(now, {});
    // It is another modem, or has come to its senses.
    for (int i = 0; i < 12 && !client.ready(); ++i) {
        if (!client.take_output().empty()) client.on_bytes(now, ise::as_bytes("\r\nOK\r\n"));
        else client.on_time(now = client.next_event());
    }
    CHECK(client.ready());
}

TEST_CASE("iridium: a modem that falls silent is asked on, and serves again when it is back") {
    pair_on_a_line it;
    it.connected = false;
    it.client.start(it.now);
    it.run(60s);
    REQUIRE(it.all<sbd_silent>().size() == 1); // said once
    CHECK_FALSE(it.client.ready());
    REQUIRE(it.client.send(it.now, bytes_of("x")));
    it.connected = true;
    it.run(30s);
    CHECK(it.client.ready());
    CHECK(it.all<sbd_sent>().size() == 1);
}

TEST_CASE("iridium: a host whose modem never comes gives its message up in time") {
    pair_on_a_line it;
    it.connected = false;
    it.client.start(it.now);
    REQUIRE(it.client.send(it.now, bytes_of("x")));
    it.run(400s);
    REQUIRE(it.all<sbd_gave_up>().size() == 1);
    CHECK_FALSE(it.client.has_message());
}

TEST_CASE("iridium: the emulated modem answers as the data sheet says") {
    modem_9602 modem("300234010753370");
    ise::time_point now{};
    auto ask = [&](std::string_view text) {
        modem.on_serial(now, ise::as_bytes(text));
        return std::string(ise::as_text(modem.take_serial()));
    };
    CHECK(ask("AT\r") == "AT\r\r\nOK\r\n"); // with its echo
    CHECK(ask("ATE0\r").ends_with("\r\nOK\r\n"));
    CHECK(ask("at+cgsn\r") == "\r\n300234010753370\r\n\r\nOK\r\n");
    CHECK(ask("AT+CSQ\r") == "\r\n+CSQ:5\r\n\r\nOK\r\n");
    CHECK(ask("AT+NOSUCH\r") == "\r\nERROR\r\n");
    CHECK(ask("AT+SBDWB=341\r") == "\r\n3\r\n\r\nOK\r\n");
    CHECK(ask("AT+SBDWB=2\r") == "\r\nREADY\r\n");
    CHECK(ask(std::string_view("hi\x00\xD0", 4)) == "\r\n2\r\n\r\nOK\r\n"); // the sum is D1
    ask("AT+SBDWB=2\r");
    CHECK(ask(std::string_view("hi\x00\xD1", 4)) == "\r\n0\r\n\r\nOK\r\n");
    ask("AT+SBDWB=2\r");
    now += 61s;
    modem.on_time(now);
    CHECK(ise::as_text(modem.take_serial()) == "\r\n1\r\n\r\nOK\r\n");
    CHECK(ask("AT+SBDS\r").find("+SBDS: 1, 1, 0, -1") != std::string::npos);
    CHECK(ask("AT+SBDD2\r") == "\r\n0\r\n\r\nOK\r\n");
    CHECK(ask("AT+SBDRB\r") == std::string("\0\0\0\0\r\nOK\r\n", 10));
    CHECK(ask(std::string(5000, 'x') + "\r") == "\r\nERROR\r\n");
}

} // namespace client_test
