// Datagrams that the shared key seals: of those that were changed, repeated, or made by somebody else none counts, and
// a side that has no key, another one, or the old scheme is told so.
#include <ise/core/buffer.hpp>
#include <ise/transport/security.hpp>
#include <ise/transport/shared_key.hpp>
#include <ise/transport/udp/channel.hpp>
#include <ise/transport/udp/seal.hpp>
#include <ise/wire/datagram.hpp>
#include <ise/wire/frame.hpp>
#include <ise/wire/sealed_datagram.hpp>

#include <support/boat_services.hpp>
#include <support/catch.hpp>
#include <support/datagram_router.hpp>
#include <support/sim_parties.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <string_view>
#include <vector>

namespace sealed_datagrams_test {

using namespace std::chrono_literals;
using namespace ise_test;
using namespace boat_services;
using ise::errc;
using ise::net::udp::key_life;
using ise::net::udp::seal;
using ise::wire::datagram_type;
using ise_test::Contains;

namespace {

constexpr ise::time_point at_start{};

std::shared_ptr<const ise::shared_key> key(char letter) {
    return ise::shared_key::make(std::string(64, letter), "a test").value();
}

// The two ends of a channel, without one.
struct ends {
    std::unique_ptr<seal> caller, called;

    explicit ends(char of_caller = 'k', char of_called = 'k', key_life life = key_life())
        : caller(seal::make(key(of_caller), true, life)), called(seal::make(key(of_called), false, life)) {}
    // Every flight comes twice.
    void shake() {
        for (int flights = 0; flights < 8 && !(caller->sealed() && called->sealed()); ++flights) {
            auto& from = flights % 2 == 0 ? caller : called;
            auto& to = flights % 2 == 0 ? called : caller;
            auto flight = flight_of(*from);
            take(*to, flight);
            take(*to, flight);
        }
    }
    static std::vector<ise::bytes> flight_of(const seal& of) { return {of.flight().begin(), of.flight().end()}; }
    // Whether it has an answer to the last of them.
    static bool take(seal& by, const std::vector<ise::bytes>& flight) {
        bool answers = false;
        for (const auto& part : flight) answers = by.take_flight(part);
        return answers;
    }
};

// A datagram of a stream's bytes, sealed.
ise::bytes made_by(seal& by, std::uint64_t number, std::string_view text, std::uint64_t acked = 0,
                   ise::time_point now = at_start) {
    ise::buffer out;
    ise::wire::data_writer writer(out, 77, number);
    out.grow(ise::wire::sealed::seal_bytes);
    writer.put(ise::wire::chunk_type::content, ise::as_bytes(text));
    writer.finish();
    by.close(out, acked, now);
    return out.to_bytes();
}

std::optional<std::string> opened_by(seal& by, const ise::bytes& datagram) {
    auto view = ise::wire::read_datagram(datagram);
    if (!view || view->type != ise::wire::sealed::data) return {};
    auto body = by.open(datagram);
    if (!body) return {};
    constexpr std::size_t heads = 8 + ise::wire::chunk_head_bytes;
    return std::string(ise::as_text(body->subspan(heads)));
}

} // namespace

TEST_CASE("seal: both ends have the key, and open each other's datagrams only") {
    ends at;
    at.shake();
    REQUIRE((at.caller->sealed() && at.called->sealed()));
    auto there = made_by(*at.caller, 0, "hold the course"), back = made_by(*at.called, 0, "aye");
    CHECK(opened_by(*at.called, there) == "hold the course");
    CHECK(opened_by(*at.caller, back) == "aye");
    CHECK_FALSE(opened_by(*at.caller, there)); // thrown back
    CHECK(there.size() == 24 + 3 + 15 + 16);
    auto view = std::string_view(reinterpret_cast<const char*>(there.data()), there.size());
    CHECK(view.find("course") == view.npos);
    CHECK(made_by(*at.caller, 1, "hold the course") != there);

    ends others;
    others.shake();
    CHECK_FALSE(opened_by(*others.called, there)); // the same key, another channel
}

TEST_CASE("seal: another key is noticed by both ends, and lost flights are said again") {
    ends at('k', 'x');
    at.shake();
    CHECK_FALSE((at.caller->sealed() || at.called->sealed()));
    REQUIRE((at.called->trouble() && at.caller->trouble()));
    CHECK_THAT(at.called->trouble()->message(), Contains("the shared key here is another one"));
    CHECK_THAT(at.caller->trouble()->message(), Contains("the shared key there is another one"));

    ends again;
    auto first = ends::flight_of(*again.caller);
    CHECK(ends::take(*again.called, first));
    auto answer = ends::flight_of(*again.called);
    CHECK(ends::take(*again.called, first)); // the answer was lost
    CHECK(ends::flight_of(*again.called) == answer);
    CHECK(ends::take(*again.caller, answer));
    auto last = ends::flight_of(*again.caller);
    CHECK(ends::take(*again.caller, answer)); // the last was lost
    CHECK_FALSE(ends::take(*again.called, last));
    CHECK_FALSE(ends::take(*again.called, last)); // there is nothing to be said to that: no two ends go on for ever
    CHECK((again.caller->sealed() && again.called->sealed()));
}

TEST_CASE("seal: flights that are cut, changed or out of turn make no session, and no end forgets itself") {
    ends usual;
    usual.shake();
    ends from;
    auto whole = ends::flight_of(*from.caller);
    const auto& first = whole.front(); // with some versions of OpenSSL there are two parts
    for (std::size_t size = 0; size < first.size(); ++size) {
        auto called = seal::make(key('k'), false);
        called->take_flight(ise::bytes_view(first).first(size));
        CHECK_FALSE(called->sealed());
    }
    for (std::size_t place = 0; place < first.size(); ++place) {
        auto called = seal::make(key('k'), false);
        auto changed = first;
        changed[place] ^= std::byte{4};
        called->take_flight(changed);
        CHECK_FALSE(called->sealed());
    }
    ends at;
    for (int number : {0, 2, 3, 7, 255}) {
        auto odd = first;
        odd[0] = static_cast<std::byte>(number);
        CHECK_FALSE(at.called->take_flight(odd));
    }
    for (auto [part, parts] :
         {std::pair(0, 0), std::pair(1, 1), std::pair(9, 3), std::pair(0, 33), std::pair(0, 255)}) {
        auto odd = first;
        odd[1] = static_cast<std::byte>(part);
        odd[2] = static_cast<std::byte>(parts);
        CHECK_FALSE(at.called->take_flight(odd));
    }
    at.shake();
    CHECK((at.caller->sealed() && at.called->sealed()));
}

TEST_CASE("seal: of changed, cut and invented datagrams none is opened") {
    ends at;
    at.shake();
    const auto good = made_by(*at.caller, 5, "starboard");
    for (std::size_t bit = 0; bit < good.size() * 8; ++bit) {
        auto bad = good;
        bad[bit / 8] ^= static_cast<std::byte>(1u << (bit % 8));
        INFO("bit " << bit);
        CHECK_FALSE(opened_by(*at.called, bad));
    }
    for (std::size_t size = 0; size < good.size(); ++size) {
        ise::bytes cut(good.begin(), good.begin() + static_cast<std::ptrdiff_t>(size));
        if (size >= 16) ise::detail::store_little(cut.data(), static_cast<std::uint32_t>(size - 16));
        CHECK_FALSE(opened_by(*at.called, cut));
    }
    std::mt19937_64 random(7);
    int accepted = 0;
    constexpr int invented = 20000;
    for (int i = 0; i < invented; ++i) {
        auto forged = good;
        for (std::size_t place = 16; place < forged.size(); ++place) forged[place] = static_cast<std::byte>(random());
        forged[5] = static_cast<std::byte>(random());
        accepted += opened_by(*at.called, forged).has_value();
    }
    CHECK(accepted == 0);
    CHECK(opened_by(*at.called, good) == "starboard"); // none of that did any harm
}

TEST_CASE("seal: keys change by count and by time, once the peer has heard the present ones, and late datagrams are "
          "opened") {
    key_life life;
    life.datagrams = 3;
    ends at('k', 'k', life);
    at.shake();
    std::vector<ise::bytes> sent;
    auto phase = [&](const ise::bytes& of) { return ise::wire::read_header(of.data()).flags; };
    for (std::uint64_t number = 0; number < 5; ++number) sent.push_back(made_by(*at.caller, number, "x", 0));
    CHECK(phase(sent[4]) == 0); // nothing was heard of the peer
    for (const auto& one : sent) CHECK(opened_by(*at.called, one));
    auto late = made_by(*at.caller, 5, "late", 0);
    auto next = made_by(*at.caller, 6, "next", 5);
    CHECK(phase(next) == 1);
    CHECK(opened_by(*at.called, next) == "next");
    CHECK(opened_by(*at.called, late) == "late");      // overtaken
    CHECK(phase(made_by(*at.caller, 9, "x", 6)) == 1); // of these none was heard
    auto third = made_by(*at.caller, 10, "third", 8);
    CHECK(phase(third) == 0);
    CHECK(opened_by(*at.called, third) == "third");
    CHECK_FALSE(opened_by(*at.called, sent[0])); // two changes ago
    auto much_later = made_by(*at.caller, 11, "by time", 11, at_start + 2h);
    CHECK(phase(much_later) == 1);
    CHECK(opened_by(*at.called, much_later) == "by time");
    CHECK(opened_by(*at.caller, made_by(*at.called, 0, "of the other direction nothing has changed")));
}

TEST_CASE("seal: a sign of life is new and of the peer, or none") {
    ends at;
    at.shake();
    auto sign = [](seal& by) {
        ise::buffer out;
        by.put_sign(out, 77);
        return out.to_bytes();
    };
    auto taken = [](seal& by, const ise::bytes& one) { return by.take_sign(one); };
    auto first = sign(*at.caller), second = sign(*at.caller);
    CHECK_FALSE(taken(*at.caller, first));
    CHECK(taken(*at.called, second));
    CHECK_FALSE(taken(*at.called, second));
    CHECK_FALSE(taken(*at.called, first));
    auto bad = sign(*at.caller);
    bad.back() ^= std::byte{1};
    CHECK_FALSE(taken(*at.called, bad));
}

namespace {

// A boat and a shore with a router between them, each with its own credentials.
struct strait {
    static ise::security_options with(const std::string& file) {
        ise::security_options made;
        made.key_file = file;
        return made;
    }
    party& add(const std::string& host, const std::string& file) {
        sea.world.host(host).write_file("key", std::string(64, 'k'));
        sea.world.host(host).write_file("other", std::string(64, 'x'));
        return sea.add(host, {}, with(file));
    }
    explicit strait(const std::string& of_boat = "key", const std::string& of_shore = "key")
        : boat(add("boat", of_boat)), shore(add("shore", of_shore)) {
        boat.provide(helm, [this](set_mode asked) {
            ++executed;
            return mode_set{true, asked.mode};
        });
        where = boat.listen("udp://10.0.0.1:7400");
        between = std::make_unique<datagram_router>(sea.world.host("router").start_process("router"), where);
        at = ise::endpoint::parse(fmt::format("udp://{}:9000", sea.world.host("router").address())).value();
        boat.services->acceptor().advertise({at});
        there.emplace(shore.at(at));
    }
    ~strait() {
        there.reset();
        sea.stop();
        between->stop(sea.world);
    }
    static ise::task<ise::result<mode_set>> ask(ise::remote whom, std::string mode, ise::duration limit) {
        set_mode wanted;
        wanted.mode = std::move(mode);
        auto got = co_await whom.try_call(helm, wanted, limit);
        co_return got;
    }
    ise::result<mode_set> call(const std::string& mode, ise::duration limit = 10s) {
        return sea.run(shore, ask(*there, mode, limit));
    }
    std::string warnings() const {
        std::string text;
        for (const auto& line : boat.warnings) text += line + "\n";
        return text;
    }

    sim_parties sea;
    party& boat;
    party& shore;
    int executed = 0;
    ise::endpoint where, at;
    std::optional<ise::remote> there; // one session for all calls
    std::unique_ptr<datagram_router> between;
};

datagram_type type_of(const ise::buffer& datagram) {
    return static_cast<datagram_type>(ise::wire::read_header(datagram.data()).type);
}

} // namespace

TEST_CASE("sealed udp: calls go, and nothing on the way can be read") {
    strait all;
    std::string heard;
    int plain = 0;
    auto listen = [&](ise::buffer& datagram) {
        heard += ise::as_text(datagram.view());
        plain += type_of(datagram) == datagram_type::data;
    };
    all.between->on_question = listen;
    all.between->on_answer = listen;
    auto got = all.call("a-secret-course");
    INFO((got ? "" : got.error().message()));
    REQUIRE(got);
    CHECK(got->reason == "a-secret-course");
    CHECK(plain == 0);
    CHECK(heard.find("a-secret-course") == heard.npos);
    CHECK(heard.find("shore") == heard.npos);
    all.between->on_question = all.between->on_answer = {};
}

TEST_CASE("sealed udp: datagrams that are changed, repeated, or of the plain kind change nothing") {
    strait all;
    REQUIRE(all.call("before"));
    auto session = all.shore.services->sessions().begin()->first;
    std::mt19937_64 random(3);
    std::vector<ise::bytes> kept;
    auto& thief = all.sea.world.host("thief").start_process("thief");
    auto host = thief.make_loop("main");
    auto socket =
        std::move(thief.open_datagram(host->loop(), ise::endpoint::parse("udp://0.0.0.0:5000").value()).value());
    auto spoil = [&](ise::buffer& datagram) {
        kept.push_back(datagram.to_bytes());
        if (kept.size() % 3 == 0) datagram.data()[16 + random() % (datagram.size() - 16)] ^= std::byte{32};
    };
    all.between->on_question = spoil;
    for (int i = 0; i < 50; ++i) {
        auto got = all.call(fmt::format("call {}", i), 30s);
        INFO((got ? "" : got.error().message()));
        REQUIRE(got);
        for (const auto& one : kept) socket->try_send(all.where, one); // all of it once more, from elsewhere
        // Endings and signs of the plain kind, by somebody who knows the ids.
        auto id = ise::wire::read_header(kept.back().data()).id;
        for (auto type : {datagram_type::closed, datagram_type::unknown, datagram_type::sign, datagram_type::data}) {
            ise::buffer out;
            ise::wire::put_datagram(out, type, id, ise::bytes(64));
            socket->try_send(all.where, out.view());
        }
        if (kept.size() > 60) kept.erase(kept.begin(), kept.end() - 20);
    }
    CHECK(all.executed == 51);
    REQUIRE(all.shore.services->sessions().size() == 1);
    CHECK(all.shore.services->sessions().begin()->first == session);
    CHECK(all.boat.services->counts().sessions_accepted == 1);
    all.between->on_question = {};
    socket->close();
}

TEST_CASE("sealed udp: a flight that is repeated in the middle of a session is not answered") {
    strait all;
    ise::bytes flight;
    all.between->on_answer = [&](ise::buffer& datagram) {
        if (type_of(datagram) == ise::wire::sealed::flight) flight = datagram.to_bytes();
    };
    REQUIRE(all.call("before"));
    REQUIRE_FALSE(flight.empty());
    int repeated = 0, answered = 0;
    all.between->on_answer = [&](ise::buffer& datagram) {
        if (repeated++ > 0) return;
        datagram.clear();
        datagram.append(flight);
    };
    all.between->on_question = [&](ise::buffer& datagram) {
        answered += type_of(datagram) == ise::wire::sealed::flight;
    };
    CHECK(all.call("after"));
    CHECK(repeated > 0);
    CHECK(answered == 0);
    all.between->on_question = all.between->on_answer = {};
}

TEST_CASE("sealed udp: what is lost of the handshake is said again") {
    strait all;
    int flights = 0;
    std::mt19937_64 random(11);
    auto lose = [&](ise::buffer& datagram) {
        if (type_of(datagram) == ise::wire::sealed::flight && (++flights <= 3 || random() % 2)) datagram.clear();
    };
    all.between->on_question = lose;
    all.between->on_answer = lose;
    auto got = all.call("after all", 60s);
    INFO((got ? "" : got.error().message()));
    CHECK(got);
    CHECK(flights > 3);
    all.between->on_question = all.between->on_answer = {};
}

TEST_CASE("sealed udp: who has no key, another one or the old scheme is told what is wanted, as is the other side") {
    struct met {
        std::string boat, shore, to_shore, to_boat;
    };
    auto one = GENERATE(values<met>({
        {"key", "other", "the shared key there is another one", "the shared key here is another one"},
        {"key", "", "a shared key is demanded here, and none was offered",
         "a shared key is demanded here, and none was offered"},
        {"", "key", "no shared key is known there", "this side has no key"},
    }));
    INFO(one.to_shore);
    strait all(one.boat, one.shore);
    auto got = all.call("no", 5s);
    REQUIRE_FALSE(got);
    CHECK_THAT(got.error().message(), Contains(one.to_shore));
    CHECK(got.error().executed() == ise::execution::not_executed);
    all.sea.world.run_for(6s);
    CHECK_THAT(all.warnings(), Contains(one.to_boat));
    CHECK(all.executed == 0);
    CHECK(all.boat.services->counts().sessions_accepted == 0);
}

TEST_CASE("sealed udp: a router may give the peer another address") {
    strait all;
    REQUIRE(all.call("before"));
    for (int i = 0; i < 5; ++i) {
        all.between->forget();
        CHECK(all.call(fmt::format("after {}", i)));
    }
    CHECK(all.boat.services->counts().sessions_accepted == 1);
}

namespace {

// ISE_SEAL_SWEEP: how many; the usual number takes a moment only.
long sweep_count() {
    const char* result = std::getenv("ISE_SEAL_SWEEP");
    return result ? std::max(std::atol(result), 1L) : 20000L;
}

} // namespace

TEST_CASE("seal: of a sweep of flipped, repeated, foreign and moved datagrams none is accepted") {
    key_life life;
    life.datagrams = 1000;
    ends at('k', 'k', life), others;
    at.shake();
    others.shake();
    ise::net::udp::channel receiving(77, ise::wire::sealed::seal_bytes);
    std::mt19937 random(20);
    std::vector<ise::bytes> passed; // the last ones, of which each was accepted once
    long flipped = 0, repeated = 0, foreign = 0, moved = 0, accepted = 0, good = 0;
    auto take = [&](const ise::bytes& datagram) {
        auto view = ise::wire::read_datagram(datagram);
        if (!view || view->type != ise::wire::sealed::data || !receiving.fresh(view->body)) return false;
        auto body = at.called->open(datagram);
        ise::net::udp::channel::events happened;
        return body && receiving.take(*body, at_start, happened);
    };
    const long count = sweep_count();
    for (long round = 0; flipped + repeated + foreign + moved < count; ++round) {
        auto number = static_cast<std::uint64_t>(round);
        ise::buffer out;
        ise::wire::data_writer writer(out, 77, number);
        out.grow(ise::wire::sealed::seal_bytes);
        writer.put(ise::wire::chunk_type::probe, random());
        writer.finish();
        at.caller->close(out, number, at_start);
        const auto now = out.to_bytes();
        for (int i = 0; i < 4; ++i) { // before the true one comes
            auto bad = now;
            auto bit = random() % (bad.size() * 8);
            bad[bit / 8] ^= static_cast<std::byte>(1u << (bit % 8));
            auto id = 8 <= bit / 8 && bit / 8 < 16; // of the channel: its port would not find one
            accepted += !id && take(bad);
            flipped += 1;
        }
        accepted += take(made_by(*others.caller, number, "of another session"));
        ++foreign;
        auto renumbered = now;
        ise::detail::store_little(renumbered.data() + ise::wire::frame_header::size, number + 1 + random() % 100);
        accepted += take(renumbered);
        ++moved;
        good += take(now);
        passed.push_back(now);
        if (passed.size() > 64) passed.erase(passed.begin(), passed.begin() + 32);
        for (int i = 0; i < 2; ++i) {
            accepted += take(passed[random() % passed.size()]);
            ++repeated;
        }
        if (good != round + 1) break;
    }
    INFO(fmt::format("{} flipped, {} repeated, {} foreign, {} moved", flipped, repeated, foreign, moved));
    CHECK(accepted == 0);
    CHECK(flipped + repeated + foreign + moved >= count);
    if (count >= 1000000) WARN(fmt::format("{} of {} accepted, {} true ones taken", accepted, count, good));
}

} // namespace sealed_datagrams_test
