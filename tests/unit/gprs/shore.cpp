#include "packets.hpp"

#include <components/gprs/shore.hpp>

#include <support/catch.hpp>

using namespace std::chrono_literals;
using namespace atirma;
using namespace atirma::gprs;

namespace {

struct coast {
    gprs::shore shore;
    ise::time_point now{1h};
    std::vector<shore_event> events;

    explicit coast(shore_options options = shore_options()) : shore(options) {}
    void drain() {
        while (auto event = shore.take_event()) events.push_back(std::move(*event));
    }
    static way call(std::uint64_t door) {
        way made;
        made.door = door;
        made.peer = ise::endpoint{ise::protocol::tcp, "10.0.0.9", static_cast<std::uint16_t>(door), {}};
        return made;
    }
    static way call(std::uint64_t door, const std::string& host) {
        auto made = call(door);
        made.peer.host = host;
        return made;
    }
    static way address(std::uint16_t port) {
        way made;
        made.door = 1;
        made.peer = ise::endpoint{ise::protocol::udp, "10.0.0.9", port, {}};
        made.datagrams = true;
        return made;
    }
    void connect(std::uint64_t door) { shore.connected(now, call(door)), drain(); }
    void connect(std::uint64_t door, const std::string& host) { shore.connected(now, call(door, host)), drain(); }
    void say(std::uint64_t door, std::string_view text) { shore.on_bytes(now, door, ise::as_bytes(text)), drain(); }
    void say(std::uint64_t door, const line& what) { say(door, encode(what)); }
    void datagram(std::uint16_t port, const std::string& text) {
        shore.on_datagram(now, address(port), ise::as_bytes(text)), drain();
    }
    void pass(ise::duration time) {
        now += time;
        shore.on_time(now);
        drain();
    }
    template <class E>
    std::vector<E> all() const {
        std::vector<E> found;
        for (const auto& event : events)
            if (const auto* one = std::get_if<E>(&event)) found.push_back(*one);
        return found;
    }
    /// The last number that was acknowledged, of any boot.
    std::optional<std::uint32_t> acknowledged() const {
        std::optional<std::uint32_t> last;
        for (const auto& sent : all<send_text>())
            for (const auto& told : gprs_test::lines_of(sent.text))
                if (const auto* ack = std::get_if<receipt>(&told)) last = ack->number;
        return last;
    }
    void safe_all() {
        for (const auto& one : all<record_came>()) shore.safe(one.life, {one.number});
        drain();
    }
};

record data(std::uint32_t number, std::uint16_t boot = 5, bool history = false) {
    record made;
    made.boot = boot;
    made.number = number;
    made.history = history;
    made.raw = gprs_test::fix(number, boot);
    return made;
}

} // namespace

TEST_CASE("gprs shore: a login is answered, records come once, and are acknowledged when they are safe, not before") {
    coast it;
    it.connect(2);
    it.say(2, login{"atirma", 5, 1, 0});
    REQUIRE(it.shore.boat());
    CHECK(it.acknowledged() == 0);
    it.say(2, data(1));
    it.say(2, data(2));
    CHECK(it.acknowledged() == 0);
    it.safe_all();
    CHECK(it.acknowledged() == 2);
    it.say(2, data(2)); // it did not hear that
    CHECK(it.all<record_came>().size() == 2);
    CHECK(it.shore.counters().resends == 1);
    CHECK(it.all<send_text>().size() == 4); // and is told again
}

TEST_CASE("gprs shore: acknowledgement is cumulative over what came in any order") {
    coast it;
    it.connect(2);
    it.say(2, login{"atirma", 5, 1, 4});
    for (std::uint32_t n : {4u, 1u, 3u}) it.say(2, data(n));
    it.safe_all();
    CHECK(it.acknowledged() == 1);
    it.say(2, data(2));
    it.safe_all();
    CHECK(it.acknowledged() == 4);
}

TEST_CASE("gprs shore: what the boat gave up is counted, and does not hold up the rest") {
    coast it;
    it.connect(2);
    it.say(2, login{"atirma", 5, 1, 0});
    it.say(2, data(1));
    it.safe_all();
    it.say(2, login{"atirma", 5, 11, 12}); // 2 … 10 had no room
    it.say(2, data(11));
    it.safe_all();
    CHECK(it.acknowledged() == 11);
    CHECK(it.shore.counters().given_up == 9);
    CHECK(it.all<remark>().size() == 1);
}

TEST_CASE("gprs shore: one that was restarted takes the boat's word for what was acknowledged before") {
    coast it;
    it.connect(2);
    it.say(2, login{"atirma", 5, 500, 501});
    CHECK(it.acknowledged() == 499);
    CHECK(it.shore.counters().given_up == 0);
    it.say(2, data(500));
    it.safe_all();
    CHECK(it.acknowledged() == 500);
}

TEST_CASE(
    "gprs shore: a boat that starts again has numbers of its own, and one that keeps its boot number is not mute") {
    coast it;
    it.connect(2);
    it.say(2, login{"atirma", 5, 1, 0});
    for (std::uint32_t n = 1; n <= 3; ++n) it.say(2, data(n));
    it.safe_all();
    it.connect(3);
    it.say(3, login{"atirma", 6, 1, 1});
    it.say(3, data(1, 6));
    it.safe_all();
    CHECK(it.all<record_came>().size() == 4);
    CHECK(it.acknowledged() == 1);
    it.connect(4);
    it.say(4, login{"atirma", 5, 1, 1}); // 5 again, which had come to 3
    it.say(4, data(1, 5));
    CHECK(it.all<record_came>().size() == 5);
    REQUIRE_FALSE(it.all<remark>().empty());
    CHECK(it.all<remark>().back().text.find("boot number") != std::string::npos);
}

TEST_CASE("gprs shore: the boat's last login counts: its connection before is cut off") {
    coast it;
    it.connect(2);
    it.say(2, login{"atirma", 5, 1, 0});
    it.connect(3);
    CHECK(it.shore.boat()->door == 2);
    it.say(3, login{"atirma", 5, 1, 0});
    CHECK(it.shore.boat()->door == 3);
    REQUIRE(it.all<cut_off>().size() == 1);
    CHECK(it.all<cut_off>().front().whom.door == 2);
    CHECK_FALSE(it.all<cut_off>().front().stranger);
    CHECK(it.shore.counters().moves == 1);
    auto before = it.events.size();
    it.say(2, data(1)); // what was under way there
    CHECK(it.events.size() == before);
    it.say(3, data(1));
    CHECK(it.all<record_came>().size() == 1);
    it.shore.disconnected(it.now, 2, "over");
    CHECK(it.shore.boat());
    it.shore.disconnected(it.now, 3, "over");
    CHECK_FALSE(it.shore.boat());
}

TEST_CASE("gprs shore: strangers who are silent, talk nonsense, too much, or go by another name are cut off") {
    coast it;
    it.connect(1);
    it.connect(2);
    it.say(2, "GET / HTTP/1.1\r\n");
    it.connect(3);
    it.say(3, login{"pirate", 5, 1, 0});
    it.connect(4);
    it.say(4, data(1));
    it.connect(5);
    for (int i = 0; i < 20; ++i) it.say(5, std::string(100, '\n')); // never a line
    it.connect(6);
    it.say(6, std::string(300, 'x'));
    auto cuts = it.all<cut_off>();
    REQUIRE(cuts.size() == 5);
    for (std::size_t i = 0; i < cuts.size(); ++i) {
        CHECK(cuts[i].stranger);
        CHECK(cuts[i].whom.door == i + 2);
        CHECK_FALSE(cuts[i].reason.empty());
    }
    CHECK(it.shore.strangers() == 1);
    it.pass(9s);
    CHECK(it.all<cut_off>().size() == 5);
    it.pass(1s);
    CHECK(it.all<cut_off>().size() == 6);
    CHECK(it.shore.strangers() == 0);
    CHECK(it.shore.counters().strangers_cut_off == 6);
    CHECK(it.shore.next_event() == ise::time_point::max());
    CHECK_FALSE(it.shore.boat());
}

TEST_CASE("gprs shore: a crowd of strangers leaves room for the boat") {
    coast it;
    for (std::uint64_t door = 1; door <= 1000; ++door) it.connect(door);
    CHECK(it.shore.strangers() == shore_options().max_strangers);
    CHECK(it.all<cut_off>().size() == 1000 - shore_options().max_strangers);
    it.connect(2000);
    it.say(2000, login{"atirma", 5, 1, 0});
    CHECK(it.shore.boat());
}

TEST_CASE("gprs shore: a slow boat keeps its place while another host calls as often as it likes") {
    coast it;
    it.connect(1, "10.0.0.1");
    for (std::uint64_t door = 2; door <= 1000; ++door) it.connect(door, door % 2 ? "fd00:1:2:3::" + std::to_string(door) : "10.0.0.9");
    for (const auto& cut : it.all<cut_off>()) CHECK(cut.whom.door != 1);
    it.pass(9s);
    it.say(1, login{"atirma", 5, 1, 0});
    CHECK(it.shore.boat());
    CHECK(it.shore.strangers() == shore_options().max_strangers - 1);
}

TEST_CASE(
    "gprs shore: the boat's own connection is cut off when it brings nothing but nonsense, and its silence is noticed") {
    coast it;
    it.connect(2);
    it.say(2, login{"atirma", 5, 1, 0});
    for (int i = 0; i < 7; ++i) it.say(2, "nonsense\r\n");
    it.say(2, login{"atirma", 5, 1, 0});
    for (int i = 0; i < 7; ++i) it.say(2, "nonsense\r\n");
    CHECK(it.shore.boat());
    it.say(2, "nonsense\r\n");
    CHECK_FALSE(it.shore.boat());
    CHECK(it.all<boat_went>().size() == 1);
    it.connect(3);
    it.say(3, login{"atirma", 5, 1, 0});
    it.pass(179s);
    CHECK(it.shore.boat());
    it.pass(1s);
    CHECK_FALSE(it.shore.boat());
    CHECK(it.shore.counters().half_open == 1);
    CHECK(it.all<cut_off>().back().whom.door == 3);
}

TEST_CASE("gprs shore: datagrams need a login first, and again from each new address") {
    coast it;
    it.datagram(40001, encode(data(1)));
    CHECK(it.all<record_came>().empty());
    CHECK(it.all<stranger_datagram>().size() == 1);
    it.datagram(40001, encode(login{"atirma", 5, 1, 1}) + encode(data(1)));
    CHECK(it.all<record_came>().size() == 1);
    it.datagram(40001, encode(data(2)));
    CHECK(it.all<record_came>().size() == 2);
    it.datagram(40002, encode(data(3))); // who is that?
    CHECK(it.all<record_came>().size() == 2);
    it.datagram(40002, encode(login{"pirate", 5, 1, 3}) + encode(data(3)));
    it.datagram(40002, "");
    it.datagram(40002, "hello");
    CHECK(it.shore.boat()->peer.port == 40001);
    CHECK(it.shore.counters().stranger_datagrams == 5);
    it.datagram(40002, encode(login{"atirma", 5, 1, 3}) + encode(data(3)));
    CHECK(it.shore.boat()->peer.port == 40002);
    CHECK(it.all<record_came>().size() == 3);
    CHECK(it.all<cut_off>().empty());
    it.safe_all();
    CHECK(it.all<send_text>().back().to.peer.port == 40002);
}

TEST_CASE("gprs shore: a login that was under way for long moves nothing back for good, and nothing is lost by it") {
    coast it;
    it.datagram(40001, encode(login{"atirma", 5, 1, 0}));
    for (std::uint32_t n = 1; n <= 20; ++n) it.datagram(40001, encode(data(n)));
    it.safe_all();
    CHECK(it.acknowledged() == 20);
    it.datagram(40001, encode(login{"atirma", 5, 1, 10}));       // of long ago
    it.datagram(40001, encode(data(21)));                        // it is not clear of which life
    CHECK(it.all<record_came>().size() == 20);
    it.datagram(40001, encode(login{"atirma", 5, 21, 21}) + encode(data(21))); // what the boat says now
    it.datagram(40001, encode(data(20)));
    it.safe_all();
    CHECK(it.acknowledged() == 21);
    CHECK(it.shore.counters().given_up == 0);
    CHECK(it.all<remark>().empty());
    // But a boat that says so for a minute has started again, under the boot number that it had.
    for (int i = 0; i < 5; ++i) {
        it.datagram(40001, encode(login{"atirma", 5, 1, 1}) + encode(data(1)));
        it.pass(15s);
    }
    CHECK(it.all<remark>().size() == 1);
    CHECK(it.all<record_came>().size() == 22);
    it.safe_all();
    CHECK(it.acknowledged() == 1);
}

TEST_CASE("gprs shore: what cannot be kept is not taken, and taken when it comes again") {
    shore_options small;
    small.max_unsafe = 2;
    coast it(small);
    it.connect(2);
    it.say(2, login{"atirma", 5, 1, 0});
    for (std::uint32_t n = 1; n <= 4; ++n) it.say(2, data(n));
    CHECK(it.all<record_came>().size() == 2);
    CHECK(it.shore.counters().postponed == 2);
    it.safe_all();
    CHECK(it.acknowledged() == 2);
    it.say(2, data(3));
    it.say(2, data(4));
    CHECK(it.all<record_came>().size() == 4);
}

TEST_CASE("gprs shore: a telecommand goes to the boat where it is, and is refused while it is nowhere") {
    coast it;
    order what;
    what.id = 7;
    what.raw = ise::bytes(4);
    CHECK_FALSE(it.shore.send(what));
    it.connect(2);
    it.say(2, login{"atirma", 5, 1, 0});
    CHECK(it.shore.send(what));
    it.drain();
    auto sent = it.all<send_text>().back();
    CHECK(sent.to.door == 2);
    CHECK(std::get<order>(gprs_test::lines_of(sent.text).front()) == what);
    it.say(2, outcome{7, 0, {}});
    REQUIRE(it.all<outcome_came>().size() == 1);
    CHECK(it.all<outcome_came>().front().what.id == 7);
}
