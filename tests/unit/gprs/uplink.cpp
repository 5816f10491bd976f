#include "packets.hpp"

#include <components/gprs/uplink.hpp>

#include <support/catch.hpp>

#include <map>

namespace uplink_test {

using namespace std::chrono_literals;
using namespace atirma;
using namespace atirma::gprs;

namespace {

struct vessel {
    uplink link;
    ise::time_point now{1h};

    explicit vessel(uplink_options options = uplink_options()) : link(5, options) {}
    std::vector<line> said() {
        std::string text;
        for (;;) {
            auto more = link.take_text(now);
            if (more.empty()) break;
            text += more;
        }
        return gprs_test::lines_of(text);
    }
    /// The records in what it says now: number and H or L.
    std::vector<std::pair<std::uint32_t, char>> records() {
        std::vector<std::pair<std::uint32_t, char>> all;
        for (const auto& one : said())
            if (const auto* data = std::get_if<record>(&one)) all.emplace_back(data->number, data->history ? 'H' : 'L');
        return all;
    }
    void hear(const line& what) { link.on_bytes(now, ise::as_bytes(encode(what))); }
    void hear_with(std::uint64_t key, const line& what) {
        link.on_bytes(now, ise::as_bytes(encode(shown_key{key}) + encode(what)));
    }
    void pass(ise::duration time) {
        now += time;
        link.on_time(now);
    }
    void reopen() {
        link.closed();
        link.opened(now);
    }
};

using records = std::vector<std::pair<std::uint32_t, char>>;

uplink_options by_datagrams() {
    uplink_options made;
    made.datagrams = true;
    made.token = 99;
    return made;
}

} // namespace

TEST_CASE("gprs boat: it logs in first, then sends what it measures as it comes, numbered without gaps") {
    vessel it;
    it.link.opened(it.now);
    auto first = it.said();
    REQUIRE(first.size() == 1);
    CHECK(std::get<login>(first.front()) == login{"atirma", 5, 1, 0});
    it.link.put(gprs_test::fix(100)); // the numbers of packets are those of all links together
    it.link.put(gprs_test::breeze(103));
    CHECK(it.records() == records{{1, 'L'}, {2, 'L'}});
    CHECK(it.link.waiting() == 2);
    it.hear(receipt{5, 1});
    CHECK(it.link.waiting() == 1);
    it.hear(receipt{5, 2});
    CHECK(it.link.waiting() == 0);
    CHECK(it.link.answered());
}

TEST_CASE("gprs boat: after a reconnect the newest fix goes first, then news, and the rest as history") {
    vessel it;
    for (std::uint32_t n = 1; n <= 6; ++n) it.link.put(n % 2 ? gprs_test::fix(n) : gprs_test::breeze(n));
    it.link.opened(it.now);
    auto first = it.said();
    CHECK(std::get<login>(first.at(0)) == login{"atirma", 5, 1, 6});
    it.reopen(); // nothing of that arrived
    it.link.put(gprs_test::breeze(7));
    CHECK(it.records() == records{{5, 'L'}, {7, 'L'}, {1, 'H'}, {2, 'H'}, {3, 'H'}, {4, 'H'}, {6, 'H'}});
    it.hear(receipt{5, 4});
    it.reopen();
    CHECK(it.records() == records{{5, 'L'}, {6, 'H'}, {7, 'H'}});
}

TEST_CASE("gprs boat: a long history goes by the window, and news does not wait for it") {
    uplink_options options;
    options.window = 4;
    vessel it(options);
    for (std::uint32_t n = 1; n <= 100; ++n) it.link.put(gprs_test::breeze(n));
    it.link.opened(it.now);
    CHECK(it.records() == records{{1, 'H'}, {2, 'H'}, {3, 'H'}, {4, 'H'}});
    it.link.put(gprs_test::fix(101));
    CHECK(it.records() == records{{101, 'L'}});
    it.hear(receipt{5, 2});
    CHECK(it.records() == records{{5, 'H'}, {6, 'H'}});
    std::uint32_t acknowledged = 2;
    while (it.link.waiting() > 0) {
        it.hear(receipt{5, std::min(acknowledged += 2, 101u)});
        it.said();
    }
    CHECK(it.link.counters().sent == 101);
    CHECK(it.link.counters().resent == 0);
}

TEST_CASE("gprs boat: what does not fit gives up the oldest, and the shore is told") {
    uplink_options options;
    options.capacity = 10;
    vessel it(options);
    it.link.opened(it.now);
    it.said();
    for (std::uint32_t n = 1; n <= 25; ++n) it.link.put(gprs_test::fix(n));
    CHECK(it.link.waiting() == 10);
    CHECK(it.link.counters().dropped == 15);
    it.pass(5s);
    auto said = it.said();
    CHECK(std::get<login>(said.at(0)) == login{"atirma", 5, 16, 25});
    CHECK(std::get<record>(said.at(1)).number == 16);
    it.hear(receipt{5, 25});
    CHECK(it.link.waiting() == 0);
}

TEST_CASE("gprs boat: three periods without an acknowledgement are a half open link, and a slow one is given more") {
    vessel it;
    it.link.opened(it.now);
    it.said();
    CHECK(it.link.next_event() == it.now + 15s);
    it.pass(14s);
    CHECK_FALSE(it.link.trouble(it.now));
    it.pass(1s);
    REQUIRE(it.link.trouble(it.now));
    CHECK(it.link.trouble(it.now)->find("half open") != std::string::npos);
    it.reopen(); // nothing came at all: perhaps it is only slow
    it.said();
    it.pass(29s);
    CHECK_FALSE(it.link.trouble(it.now));
    it.hear(receipt{5, 0});
    CHECK(it.link.answered());
    it.link.put(gprs_test::fix(1));
    it.said();
    it.pass(60s); // it takes half a minute, as is known by now
    CHECK_FALSE(it.link.trouble(it.now));
    it.pass(30s);
    CHECK(it.link.trouble(it.now));
}

TEST_CASE("gprs boat: while nothing is to be said it asks from time to time whether the shore is there") {
    vessel it;
    it.link.opened(it.now);
    it.said();
    it.hear(receipt{5, 0});
    CHECK(it.link.next_event() == it.now + 60s);
    it.pass(59s);
    CHECK(it.said().empty());
    it.pass(1s);
    CHECK(std::holds_alternative<login>(it.said().at(0)));
    it.pass(15s);
    CHECK(it.link.trouble(it.now));
}

TEST_CASE(
    "gprs boat: a datagram that was lost is sent again, as history, after a login: the address may have changed") {
    vessel it(by_datagrams());
    it.link.opened(it.now);
    it.said();
    it.hear(challenge{99, 8});
    it.said();
    it.hear_with(8, receipt{5, 0});
    for (std::uint32_t n = 1; n <= 3; ++n) it.link.put(gprs_test::fix(n));
    CHECK(it.records() == records{{1, 'L'}, {2, 'L'}, {3, 'L'}});
    it.pass(5s);
    auto text = it.link.take_text(it.now); // one datagram
    auto both = gprs_test::lines_of(text);
    REQUIRE(both.size() == 3);
    CHECK(std::get<shown_key>(both[0]).key == 8);
    CHECK(std::get<login>(both[1]) == login{"atirma", 5, 1, 3, 99});
    CHECK(std::get<record>(both[2]).number == 1);
    CHECK(std::get<record>(both[2]).history);
    CHECK(it.records() == records{{2, 'H'}, {3, 'L'}}); // the newest fix is no history
    it.hear_with(8, receipt{5, 3});
    it.pass(5s);
    CHECK(it.said().empty());
    CHECK(it.link.counters().resent == 3);
}

TEST_CASE("gprs boat: by datagrams it says nothing but its login until the shore has sent the key of its address") {
    vessel it(by_datagrams());
    it.link.put(gprs_test::fix(1));
    it.link.opened(it.now);
    const line asks = login{"atirma", 5, 1, 1, 99};
    CHECK(it.said() == std::vector{asks});
    CHECK(it.said().empty());
    it.pass(5s); // it may have been lost
    CHECK(it.said() == std::vector{asks});
    it.hear(challenge{98, 8}); // of who does not know what it said
    CHECK(it.said().empty());
    it.hear(challenge{99, 8});
    auto said = it.said();
    REQUIRE(said.size() == 3);
    CHECK(said[0] == line(shown_key{8}));
    CHECK(said[1] == asks);
    CHECK(std::get<record>(said[2]).number == 1);
    it.hear(challenge{99, 8}); // doubled on the way
    CHECK(it.said().empty());
    it.hear(challenge{99, 9}); // the address is another one now: what was sent meanwhile was a stranger's
    it.pass(0s);
    said = it.said();
    REQUIRE(said.size() == 3);
    CHECK(said[0] == line(shown_key{9}));
    CHECK(std::get<record>(said[2]).number == 1);
}

TEST_CASE("gprs boat: a datagram without its key forgets no packet, brings no telecommand and closes no way") {
    vessel it(by_datagrams());
    it.link.put(gprs_test::fix(1));
    it.link.opened(it.now);
    it.said();
    it.hear(challenge{99, 8});
    it.said();
    order result;
    result.id = 77;
    result.raw = ise::bytes(20, std::byte{1});
    for (int i = 0; i < 20; ++i) {
        it.hear(receipt{5, 1});
        it.hear(result);
        it.hear_with(7, receipt{5, 1});
        it.hear_with(7, result);
    }
    CHECK(it.link.waiting() == 1);
    CHECK_FALSE(it.link.take_order());
    CHECK_FALSE(it.link.answered());
    CHECK_FALSE(it.link.trouble(it.now));
    it.hear_with(8, receipt{5, 1});
    it.hear_with(8, result);
    CHECK(it.link.waiting() == 0);
    CHECK(it.link.take_order());
}

TEST_CASE("gprs boat: a telecommand is taken, its acknowledgement goes back as its outcome and needs no number") {
    vessel it;
    it.link.opened(it.now);
    it.said();
    order result;
    result.id = 77;
    result.raw = ise::bytes(20, std::byte{1});
    it.hear(result);
    auto taken = it.link.take_order();
    REQUIRE(taken);
    CHECK(*taken == result);
    CHECK_FALSE(it.link.take_order());
    it.link.put(gprs_test::ack_of(77));
    auto said = it.said();
    REQUIRE(said.size() == 1);
    CHECK(std::get<outcome>(said[0]).id == 77);
    CHECK(parse_acknowledgement(std::get<outcome>(said[0]).raw)->text == "hold");
    CHECK(it.link.waiting() == 0);
}

TEST_CASE("gprs boat: what waited while the key was changed is sealed under the key in use, a notice under its own") {
    auto epoch = std::byte{0x80}; // takes the place of the version
    uplink_options options;
    options.seal = [&epoch](ise::bytes raw) {
        raw.front() = epoch;
        return raw;
    };
    vessel it(options);
    it.link.put(gprs_test::fix(1));
    it.link.put_sealed(ise::bytes{std::byte{0x80}, std::byte{0x48}});
    it.link.opened(it.now);
    for (const auto& one : it.said())
        if (const auto* data = std::get_if<record>(&one)) CHECK(data->raw.front() == std::byte{0x80});
    it.link.put(gprs_test::ack_of(77));
    epoch = std::byte{0x81}; // over another link, before anything was acknowledged
    it.link.put(gprs_test::fix(2));
    it.reopen();
    std::map<std::uint32_t, std::byte> first_bytes;
    for (const auto& one : it.said()) {
        if (const auto* data = std::get_if<record>(&one)) first_bytes[data->number] = data->raw.front();
        if (const auto* answer = std::get_if<outcome>(&one)) first_bytes[answer->id] = answer->raw.front();
    }
    CHECK(first_bytes == std::map<std::uint32_t, std::byte>{
                             {1, std::byte{0x81}}, {2, std::byte{0x80}}, {3, std::byte{0x81}}, {77, std::byte{0x81}}});
}

TEST_CASE("gprs boat: acknowledgements that make no sense are no acknowledgements") {
    vessel it;
    it.link.opened(it.now);
    it.link.put(gprs_test::fix(1));
    it.said();
    it.hear(receipt{5, 2}); // never sent
    it.hear(receipt{4, 1}); // of another life
    it.link.on_bytes(it.now, ise::as_bytes("noise\r\n"));
    it.hear(login{"atirma", 5, 1, 1});
    CHECK(it.link.waiting() == 1);
    CHECK_FALSE(it.link.answered());
    CHECK(it.link.counters().malformed == 4);
    for (int i = 0; i < 4; ++i) it.link.on_bytes(it.now, ise::as_bytes("noise\r\n"));
    CHECK(it.link.trouble(it.now));
}

TEST_CASE("gprs boat: an unusable name is refused") {
    for (const auto* name : {"", "two words", "comma,", "012345678901234567890123456789012"}) {
        uplink_options options;
        options.id = name;
        CHECK_THROWS_AS(uplink(1, options), ise::error);
    }
}

} // namespace uplink_test
