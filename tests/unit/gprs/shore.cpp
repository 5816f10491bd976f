#include "packets.hpp"

#include <components/gprs/shore.hpp>

#include <support/catch.hpp>

namespace shore_test {

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
    static way call(std::uint64_t channel) {
        way made;
        made.channel = channel;
        made.peer = ise::endpoint{ise::protocol::tcp, "10.0.0.9", static_cast<std::uint16_t>(channel), {}};
        return made;
    }
    static way call(std::uint64_t channel, const std::string& host) {
        auto made = call(channel);
        made.peer.host = host;
        return made;
    }
    static way address(std::uint16_t port) {
        way made;
        made.channel = 1;
        made.peer = ise::endpoint{ise::protocol::udp, "10.0.0.9", port, {}};
        made.datagrams = true;
        return made;
    }
    void connect(std::uint64_t channel) { shore.connected(now, call(channel)), drain(); }
    void connect(std::uint64_t channel, const std::string& host) { shore.connected(now, call(channel, host)), drain(); }
    void say(std::uint64_t channel, std::string_view text) {
        shore.on_bytes(now, channel, ise::as_bytes(text)), drain();
    }
    void say(std::uint64_t channel, const line& what) { say(channel, encode(what)); }
    void datagram(std::uint16_t port, const std::string& text) {
        shore.on_datagram(now, address(port), ise::as_bytes(text)), drain();
    }
    /// The key that the shore sent to that address.
    std::string key(std::uint16_t port) const {
        for (const auto& sent : all<send_text>())
            if (sent.to == address(port))
                for (const auto& result : gprs_test::lines_of(sent.text))
                    if (const auto* asked = std::get_if<challenge>(&result)) return encode(shown_key{asked->key});
        return {};
    }
    /// As the boat does it: asks for the key, then shows it with all that it says.
    void prove(std::uint16_t port, const login& what) {
        datagram(port, encode(what));
        datagram(port, key(port) + encode(what));
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
            for (const auto& result : gprs_test::lines_of(sent.text))
                if (const auto* ack = std::get_if<receipt>(&result)) last = ack->number;
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

TEST_CASE("gprs shore: a record that cannot be read is as if it had not come, and takes no room") {
    shore_options options;
    options.max_unsafe = 3;
    coast it(options);
    it.connect(2);
    it.say(2, login{"atirma", 5, 1, 4});
    for (std::uint32_t n : {1u, 2u, 3u}) it.say(2, data(n));
    auto life = it.all<record_came>().front().life;
    it.shore.refused(life, 2);
    CHECK(it.shore.unsafe() == 2);
    it.shore.safe(life, {1, 3});
    it.drain();
    CHECK(it.acknowledged() == 1);
    it.events.clear();
    it.say(2, data(2)); // under another key
    REQUIRE(it.all<record_came>().size() == 1);
    it.safe_all();
    CHECK(it.acknowledged() == 3);
    it.events.clear();
    it.say(2, data(4));
    it.say(2, login{"atirma", 5, 5, 5}); // it has given that up
    it.shore.refused(life, 4);
    it.shore.refused(life + 1, 1); // of a life that is over
    it.say(2, data(5));
    it.shore.safe(life, {5});
    it.drain();
    CHECK(it.acknowledged() == 5);
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
    CHECK(it.shore.boat()->channel == 2);
    it.say(3, login{"atirma", 5, 1, 0});
    CHECK(it.shore.boat()->channel == 3);
    REQUIRE(it.all<cut_off>().size() == 1);
    CHECK(it.all<cut_off>().front().whom.channel == 2);
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
        CHECK(cuts[i].whom.channel == i + 2);
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
    for (std::uint64_t channel = 1; channel <= 1000; ++channel) it.connect(channel);
    CHECK(it.shore.strangers() == shore_options().max_strangers);
    CHECK(it.all<cut_off>().size() == 1000 - shore_options().max_strangers);
    it.connect(2000);
    it.say(2000, login{"atirma", 5, 1, 0});
    CHECK(it.shore.boat());
}

TEST_CASE("gprs shore: a slow boat keeps its place while another host calls as often as it likes") {
    coast it;
    it.connect(1, "10.0.0.1");
    for (std::uint64_t channel = 2; channel <= 1000; ++channel)
        it.connect(channel, channel % 2 ? "fd00:1:2:3::" + std::to_string(channel) : "10.0.0.9");
    for (const auto& cut : it.all<cut_off>()) CHECK(cut.whom.channel != 1);
    it.pass(9s);
    it.say(1, login{"atirma", 5, 1, 0});
    CHECK(it.shore.boat());
    CHECK(it.shore.strangers() == shore_options().max_strangers - 1);
}

TEST_CASE("gprs shore: the boat's own connection is cut off when it brings nothing but nonsense, and its silence is "
          "noticed") {
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
    CHECK(it.all<cut_off>().back().whom.channel == 3);
}

TEST_CASE("gprs shore: datagrams need a login first, which shows the key that was sent to their address") {
    coast it;
    it.datagram(40001, encode(data(1)));
    CHECK(it.all<record_came>().empty());
    CHECK(it.all<stranger_datagram>().size() == 1);
    CHECK(it.all<send_text>().empty()); // a stranger gets no answer
    it.datagram(40001, encode(login{"atirma", 5, 1, 1, 99}) + encode(data(1)));
    CHECK_FALSE(it.shore.boat()); // somebody may have written that address into it
    REQUIRE(it.all<send_text>().size() == 1);
    auto asked = gprs_test::lines_of(it.all<send_text>().front().text);
    REQUIRE(asked.size() == 1);
    CHECK(std::get<challenge>(asked.front()).token == 99);
    it.datagram(40001, encode(shown_key{1}) + encode(login{"atirma", 5, 1, 1, 99}));
    CHECK_FALSE(it.shore.boat());
    it.datagram(40001, it.key(40001) + encode(login{"atirma", 5, 1, 1, 99}) + encode(data(1)));
    CHECK(it.all<record_came>().size() == 1);
    it.datagram(40001, it.key(40001) + encode(data(2)));
    CHECK(it.all<record_came>().size() == 2);
    it.datagram(40001, encode(data(3))); // whoever writes that address into a datagram does not know its key
    it.datagram(40002, it.key(40001) + encode(data(3))); // who is that?
    CHECK(it.all<record_came>().size() == 2);
    it.datagram(40002, encode(login{"pirate", 5, 1, 3, 99}) + encode(data(3)));
    it.datagram(40002, "");
    it.datagram(40002, "hello");
    CHECK(it.shore.boat()->peer.port == 40001);
    CHECK(it.shore.counters().stranger_datagrams == 6);
    it.datagram(40002, it.key(40001) + encode(login{"atirma", 5, 1, 3, 99}) + encode(data(3)));
    CHECK(it.shore.boat()->peer.port == 40001); // that key is of another address
    it.datagram(40002, it.key(40002) + encode(login{"atirma", 5, 1, 3, 99}) + encode(data(3)));
    CHECK(it.shore.boat()->peer.port == 40002);
    CHECK(it.all<record_came>().size() == 3);
    CHECK(it.all<cut_off>().empty());
    it.safe_all();
    auto last = it.all<send_text>().back();
    CHECK(last.to.peer.port == 40002);
    CHECK(last.text.starts_with(it.key(40002))); // so the boat knows who says it
}

TEST_CASE("gprs shore: keys follow from the shore's secret") {
    shore_options other;
    other.secret = {3, 4};
    coast one, two(other);
    for (auto* it : {&one, &two}) it->datagram(40001, encode(login{"atirma", 5, 1, 0}));
    CHECK(one.key(40001) != two.key(40001));
    two.datagram(40001, one.key(40001) + encode(login{"atirma", 5, 1, 0}));
    CHECK_FALSE(two.shore.boat());
}

TEST_CASE("gprs shore: a login by datagram cuts off no connection of the boat, and gets none of its telecommands") {
    coast it;
    it.connect(2);
    it.say(2, login{"atirma", 5, 1, 0, 99});
    auto said = it.all<send_text>().size();
    it.datagram(40001, encode(login{"atirma", 5, 1, 0, 7}));
    it.datagram(40001, encode(shown_key{0}) + encode(login{"atirma", 5, 1, 0, 7}));
    CHECK(it.all<send_text>().size() == said); // not even a key
    CHECK(it.all<cut_off>().empty());
    CHECK(it.shore.boat()->channel == 2);
    CHECK(it.all<stranger_datagram>().size() == 2);
    order what;
    what.id = 7;
    what.raw = ise::bytes(4);
    CHECK(it.shore.send(what));
    it.drain();
    CHECK(it.all<send_text>().back().to.channel == 2);
    it.pass(180s); // the connection is silent: it is given up, and datagrams may come in its place
    it.prove(40001, login{"atirma", 5, 1, 0, 99});
    CHECK(it.shore.boat()->datagrams);
    it.connect(3);
    it.say(3, login{"atirma", 5, 1, 0, 99});
    CHECK(it.shore.boat()->channel == 3);
}

TEST_CASE(
    "gprs shore: an answer counts for the life of the boat that the telecommand went to, by whichever way it comes") {
    coast it;
    order what;
    what.id = 7;
    what.raw = ise::bytes(4);
    it.connect(2);
    it.say(2, login{"atirma", 5, 1, 0, 99});
    it.say(2, outcome{7, 0, {}}); // nobody has asked for that yet
    CHECK(it.all<outcome_came>().empty());
    CHECK(it.shore.send(what));
    it.shore.disconnected(it.now, 2, "over");
    it.prove(40001, login{"atirma", 5, 1, 0, 7}); // calls itself so
    it.datagram(40001, it.key(40001) + encode(outcome{7, 0, {}}));
    CHECK(it.all<outcome_came>().empty());
    CHECK(it.shore.counters().strange_outcomes == 2);
    it.connect(3);
    it.say(3, login{"atirma", 5, 1, 0, 99});
    it.say(3, outcome{7, 0, {}}); // the boat's own, which was under way when its connection broke
    CHECK(it.all<outcome_came>().size() == 1);
    for (std::uint32_t id = 100; id < 1100; ++id) {
        what.id = id;
        it.shore.send(what);
    }
    it.say(3, outcome{100, 0, {}}); // forgotten: it comes again when it is asked for again
    it.say(3, outcome{1099, 0, {}});
    CHECK(it.all<outcome_came>().size() == 2);
}

TEST_CASE("gprs shore: nothing that somebody says in the boat's name destroys what the boat still holds") {
    for (bool datagrams : {true, false}) {
        coast it;
        it.connect(2);
        it.say(2, login{"atirma", 5, 1, 0, 99});
        for (std::uint32_t n = 1; n <= 3; ++n) it.say(2, data(n));
        it.safe_all();
        it.shore.disconnected(it.now, 2, "an outage");
        const login forged{"atirma", 5, 8, 20, 7}; // "1 to 7 are given up"
        if (datagrams) it.prove(40001, forged);
        else it.connect(3), it.say(3, forged);
        for (std::uint32_t n = 8; n <= 20; ++n)
            datagrams ? it.datagram(40001, it.key(40001) + encode(data(n))) : it.say(3, data(n));
        it.safe_all();
        it.connect(4);
        it.say(4, login{"atirma", 5, 4, 20, 99});
        CHECK(it.acknowledged() == 3);
        for (std::uint32_t n = 4; n <= 20; ++n) it.say(4, data(n));
        it.safe_all();
        CHECK(it.acknowledged() == 20);
        CHECK(it.all<record_came>().size() == 3 + 13 + 17);
        CHECK(it.shore.counters().given_up == 0);
    }
}

TEST_CASE("gprs shore: a login that was under way for long moves nothing back, and nothing is lost by it") {
    coast it;
    it.prove(40001, login{"atirma", 5, 1, 0});
    auto key = it.key(40001);
    for (std::uint32_t n = 1; n <= 20; ++n) it.datagram(40001, key + encode(data(n)));
    it.safe_all();
    CHECK(it.acknowledged() == 20);
    it.datagram(40001, key + encode(login{"atirma", 5, 1, 10})); // of long ago
    it.datagram(40001, key + encode(data(21)));
    it.datagram(40001, key + encode(login{"atirma", 5, 21, 21}) + encode(data(21))); // what the boat says now
    it.datagram(40001, key + encode(data(20)));
    it.safe_all();
    CHECK(it.all<record_came>().size() == 21);
    CHECK(it.acknowledged() == 21);
    CHECK(it.shore.counters().given_up == 0);
    CHECK(it.all<remark>().empty());
    // A boat that has started again has another token, also under the boot number that it had.
    it.datagram(40001, key + encode(login{"atirma", 5, 1, 1, 2}) + encode(data(1)));
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
    CHECK(sent.to.channel == 2);
    CHECK(std::get<order>(gprs_test::lines_of(sent.text).front()) == what);
    it.say(2, outcome{7, 0, {}});
    REQUIRE(it.all<outcome_came>().size() == 1);
    CHECK(it.all<outcome_came>().front().what.id == 7);
}

} // namespace shore_test
