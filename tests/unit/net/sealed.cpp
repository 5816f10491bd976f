// Sessions that the shared key seals: nobody on the way reads, changes, repeats or takes over what passes, and a side
// that has no key, another one, or the old scheme is told so, as is the other.
#include <ise/core/inproc_stream.hpp>
#include <ise/net/handshake.hpp>
#include <ise/packet/codec.hpp>
#include <ise/sim/world.hpp>
#include <ise/transport/sealed_stream.hpp>
#include <ise/transport/security.hpp>
#include <ise/transport/shared_key.hpp>
#include <ise/transport/tls/psk.hpp>
#include <ise/transport/tls/stream.hpp>
#include <ise/wire/body.hpp>

#include <asio/buffer.hpp>

#include <support/boat_services.hpp>
#include <support/catch.hpp>
#include <support/party.hpp>
#include <support/raw_peer.hpp>
#include <support/sim_parties.hpp>

#include <algorithm>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace sealed_test {

using namespace std::chrono_literals;
using namespace ise_test;
using namespace boat_services;
using ise::errc;
using ise_test::Contains;
using made = ise::result<std::shared_ptr<ise::net::connection>>;
using key_ptr = std::shared_ptr<const ise::shared_key>;

namespace {

key_ptr key(char letter, bool legacy = false) {
    return ise::shared_key::make(std::string(64, letter), "a test", legacy).value();
}

const char* failure_of(const made& one) {
    static std::string text;
    text = one ? "a session" : one.error().message();
    return text.c_str();
}

struct gate_of_boat final : ise::net::gatekeeper {
    int asked = 0;
    ise::result<ise::wire::welcome> admit(const ise::wire::hello&) override {
        ++asked;
        ise::wire::welcome yes;
        yes.self.path = "a-name-of-a-boat";
        return yes;
    }
};

// Two sides and what lies between them, which may change what passes.
struct meeting {
    using tamper = std::function<void(ise::bytes&, std::size_t before)>;

    ise::sim::world world;
    ise::sim::process& env = world.host("a").start_process("a");
    std::unique_ptr<ise::loop_host> host = env.make_loop("main");
    ise::loop& on = host->loop();
    std::unique_ptr<ise::stream> near, near_end, far_end, far;
    gate_of_boat gate;
    tamper to_responder, to_initiator;
    ise::bytes said_by_initiator, said_by_responder; ///< what passed
    std::vector<std::shared_ptr<started<void>>> passing;

    meeting() {
        std::tie(near, near_end) = ise::make_inproc_pair(on, on, "initiator");
        std::tie(far_end, far) = ise::make_inproc_pair(on, on, "responder");
    }
    ~meeting() {
        for (auto* end : {near_end.get(), far_end.get()}) end->close();
        world.run_until([&] { return std::ranges::all_of(passing, [](auto& one) { return one->done; }); });
    }
    static ise::task<> pass(ise::stream& from, ise::stream& to, tamper& change, ise::bytes& said) {
        ise::bytes room(4096);
        for (;;) {
            auto got = co_await from.read_some(asio::buffer(room));
            if (got.problem) break;
            ise::bytes piece(room.begin(), room.begin() + static_cast<std::ptrdiff_t>(got.bytes));
            if (change) change(piece, said.size());
            said.insert(said.end(), piece.begin(), piece.end());
            asio::const_buffer raw(piece.data(), piece.size());
            to.try_write(std::span(&raw, 1));
        }
        to.shutdown_write();
    }
    // As the rows of tcp and local do it: sealed where the key seals.
    static ise::task<made> call(meeting& at, key_ptr with) {
        auto line = std::move(at.near);
        if (with && with->seals()) {
            auto sealed = co_await ise::net::tls::greet(at.on, std::move(line), with,
                                                        ise::endpoint::parse("tcp://boat:7400").value());
            if (!sealed) co_return sealed.error();
            line = std::move(*sealed);
        }
        ise::wire::hello mine;
        mine.self.path = "a-name-of-a-shore";
        auto got = co_await ise::net::initiate(at.on, std::move(line), mine, at.on.now() + 5s, with.get());
        co_return got;
    }
    static ise::task<made> answer(meeting& at, key_ptr with) {
        auto line = std::move(at.far);
        if (with && with->seals()) line = ise::net::tls::answer(at.on, std::move(line), with);
        auto got = co_await ise::net::respond(at.on, std::move(line), at.gate, at.on.now() + 5s, with.get());
        co_return got;
    }
    std::shared_ptr<started<made>> initiate(key_ptr with) { return start(on, call(*this, std::move(with))); }
    std::shared_ptr<started<made>> respond(key_ptr with) { return start(on, answer(*this, std::move(with))); }
    void connect() {
        passing.push_back(start(on, pass(*near_end, *far_end, to_responder, said_by_initiator)));
        passing.push_back(start(on, pass(*far_end, *near_end, to_initiator, said_by_responder)));
    }
    template <class... Started>
    void finish(const Started&... all) {
        REQUIRE(world.run_until([&] { return (all->done && ...); }, 1min));
    }
    void say(ise::stream& to, ise::bytes_view what) {
        asio::const_buffer raw(what.data(), what.size());
        to.try_write(std::span(&raw, 1));
    }
};

struct outcome {
    made client, server;
    int asked = 0;
    ise::bytes to_responder, to_initiator; ///< that passed
};
outcome meet(const key_ptr& client, const key_ptr& server, meeting::tamper to_responder = {},
             meeting::tamper to_initiator = {}) {
    meeting at;
    at.to_responder = std::move(to_responder);
    at.to_initiator = std::move(to_initiator);
    auto calls = at.initiate(client);
    auto answers = at.respond(server);
    at.connect();
    at.finish(calls, answers);
    return {calls->get(), answers->get(), at.gate.asked, at.said_by_initiator, at.said_by_responder};
}

bool has(const ise::bytes& all, std::string_view text) {
    auto view = std::string_view(reinterpret_cast<const char*>(all.data()), all.size());
    return view.find(text) != view.npos;
}

} // namespace

TEST_CASE("sealed: both sides have the key and talk, and nothing of what they say can be read") {
    auto same = meet(key('k'), key('k'));
    INFO(failure_of(same.client));
    REQUIRE((same.client && same.server));
    CHECK((*same.client)->terms().peer.path == "a-name-of-a-boat");
    CHECK((*same.server)->terms().peer.path == "a-name-of-a-shore");
    CHECK_FALSE(has(same.to_responder, "a-name-of"));
    CHECK_FALSE(has(same.to_initiator, "a-name-of"));
    CHECK_FALSE(has(same.to_responder, std::string(32, 'k')));
    auto plain = meet(nullptr, nullptr); // the check finds it where it is
    CHECK(has(plain.to_responder, "a-name-of-a-shore"));
    CHECK(has(plain.to_initiator, "a-name-of-a-boat"));
}

TEST_CASE("sealed: what two sessions with one key say differs from the first random number on") {
    auto one = meet(key('k'), key('k'));
    auto other = meet(key('k'), key('k'));
    REQUIRE((one.client && other.client));
    constexpr std::size_t hello_random = 5 + 4 + 2, random_bytes = 32;
    auto part = [](const ise::bytes& all, std::size_t from, std::size_t count) {
        REQUIRE(all.size() >= from + count);
        auto begin = all.begin() + static_cast<std::ptrdiff_t>(from);
        return ise::bytes(begin, begin + static_cast<std::ptrdiff_t>(count));
    };
    CHECK(part(one.to_responder, hello_random, random_bytes) != part(other.to_responder, hello_random, random_bytes));
    CHECK(part(one.to_responder, one.to_responder.size() - 64, 64) !=
          part(other.to_responder, other.to_responder.size() - 64, 64));
}

TEST_CASE("sealed: another key is refused on both sides, and who has it learns nothing of who is here") {
    auto other = meet(key('k'), key('x'));
    REQUIRE_FALSE((other.client || other.server));
    CHECK(other.client.error().code() == errc::unauthorized);
    CHECK_THAT(other.client.error().message(),
               Contains("tcp://boat:7400") && Contains("the shared key there is another one"));
    CHECK(other.server.error().code() == errc::unauthorized);
    CHECK_THAT(other.server.error().message(), Contains("the shared key here is another one"));
    CHECK(other.asked == 0);
    CHECK_FALSE(has(other.to_initiator, "a-name-of"));
}

TEST_CASE("sealed: a side without a key, or with the old scheme, is told what is wanted, as is the other side") {
    struct met {
        key_ptr client, server;
        std::string to_client, to_server;
    };
    auto cases = std::vector<met>{
        {nullptr, key('k'), "rejected the session: a shared key is demanded here, and none was offered",
         "a shared key is demanded here, and none was offered"},
        {key('k'), nullptr, "no shared key is known there", "this side has no key"},
        {key('k', true), key('k'), "sessions with the shared key are sealed here", "proves it by the old scheme"},
        {key('k'), key('k', true), "the shared key is proved by the old scheme there",
         "proves its key by the old scheme"},
    };
    for (const auto& [client, server, to_client, to_server] : cases) {
        INFO(to_client);
        auto got = meet(client, server);
        REQUIRE_FALSE((got.client || got.server));
        CHECK(got.client.error().code() == errc::unauthorized);
        CHECK_THAT(got.client.error().message(), Contains(to_client));
        CHECK(got.server.error().code() == errc::unauthorized);
        CHECK_THAT(got.server.error().message(), Contains(to_server));
        CHECK(got.asked == 0);
    }
    auto old = meet(key('k', true), key('k', true)); // of one mind
    CHECK((old.client && old.server));
    CHECK(has(old.to_responder, "hmac-sha256"));
}

TEST_CASE("sealed: whatever bit is changed on the way, no side is deceived") {
    auto good = meet(key('k'), key('k'));
    REQUIRE(good.client);
    int harmless = 0; // the versions in the heads of the first records, which mean nothing
    for (bool to_responder : {true, false}) {
        const auto size = (to_responder ? good.to_responder : good.to_initiator).size();
        for (std::size_t place = 0; place < size; ++place) {
            INFO((to_responder ? "to the responder, byte " : "to the initiator, byte ") << place);
            meeting::tamper flip = [place](ise::bytes& piece, std::size_t before) {
                if (place >= before && place < before + piece.size()) piece[place - before] ^= std::byte{1};
            };
            auto bad = to_responder ? meet(key('k'), key('k'), flip) : meet(key('k'), key('k'), {}, flip);
            if (bad.client) CHECK((*bad.client)->terms().peer.path == "a-name-of-a-boat");
            if (bad.client) CHECK(bad.asked == 1);
            if (bad.server) CHECK((*bad.server)->terms().peer.path == "a-name-of-a-shore");
            if (bad.client && bad.server) ++harmless;
        }
    }
    CHECK(harmless <= 4);
}

TEST_CASE("sealed: the handshake is cut at every byte, and ends at both sides") {
    auto good = meet(key('k'), key('k'));
    REQUIRE(good.client);
    for (bool to_responder : {true, false}) {
        const auto size = (to_responder ? good.to_responder : good.to_initiator).size();
        for (std::size_t place = 0; place < size; ++place) {
            INFO((to_responder ? "to the responder, byte " : "to the initiator, byte ") << place);
            meeting at;
            auto& cut = to_responder ? at.to_responder : at.to_initiator;
            cut = [&at, place](ise::bytes& piece, std::size_t before) {
                if (before + piece.size() <= place) return;
                piece.resize(place > before ? place - before : 0);
                at.near_end->close();
                at.far_end->shutdown_write();
            };
            auto calls = at.initiate(key('k'));
            auto answers = at.respond(key('k'));
            at.connect();
            at.finish(calls, answers);
            CHECK_FALSE(calls->get());
        }
    }
}

TEST_CASE("sealed: a handshake whose bytes stall ends at the deadline, at both sides") {
    auto good = meet(key('k'), key('k'));
    REQUIRE(good.client);
    meeting at;
    at.to_responder = [](ise::bytes& piece, std::size_t before) {
        piece.resize(before < 40 ? std::min<std::size_t>(piece.size(), 40 - before) : 0);
    };
    auto answers = at.respond(key('k'));
    auto calls = at.initiate(key('k'));
    at.connect();
    at.finish(answers);
    CHECK(answers->get().error().code() == errc::timed_out);
    at.near_end->close(); // what a deadline of connecting does
    at.finish(calls);
    CHECK_FALSE(calls->get());
}

TEST_CASE("sealed: what was overheard is worth nothing in the next handshake") {
    auto first = meet(key('k'), key('k'));
    REQUIRE((first.client && first.server));
    meeting again;
    again.env.random();
    SECTION("to the side that was called: it answers, and what follows is not for these keys") {
        auto once_more = again.respond(key('k'));
        again.say(*again.far_end, first.to_responder);
        again.finish(once_more);
        REQUIRE_FALSE(once_more->get());
        CHECK(again.gate.asked == 0);
    }
    SECTION("to the side that called") {
        auto once_more = again.initiate(key('k'));
        again.say(*again.near_end, first.to_initiator);
        again.near_end->shutdown_write();
        again.finish(once_more);
        REQUIRE_FALSE(once_more->get());
    }
}

TEST_CASE("sealed: bytes that are no sealed session are refused, and nothing waits for more than the deadline") {
    meeting at;
    auto answers = at.respond(key('k'));
    std::string how;
    SECTION("http") {
        at.say(*at.far_end, ise::as_bytes("GET / HTTP/1.1\r\n\r\n"));
        at.far_end->shutdown_write();
        how = "nor is it a peer of ISE";
    }
    SECTION("nothing but the beginning of a record") {
        at.say(*at.far_end, ise::as_bytes("\x16\x03\x01"));
        how = "did not greet in time";
    }
    SECTION("a record of noise") {
        at.say(*at.far_end, ise::as_bytes(std::string("\x16\x03\x01\x00\x20", 5) + std::string(32, 'x')));
        at.far_end->shutdown_write();
        how = "the sealed session broke";
    }
    SECTION("a frame that is no hello") {
        at.say(*at.far_end, ise::as_bytes(std::string(16, '\0')));
        at.far_end->shutdown_write();
        how = "nor is it a peer of ISE";
    }
    SECTION("a hello whose length looks like the beginning of TLS") {
        at.say(*at.far_end, ise::as_bytes(std::string("\x16\x03\x00\x00\x01", 5) + std::string(100, '\0')));
        at.far_end->shutdown_write();
        how = "a shared key is demanded here";
    }
    at.finish(answers);
    REQUIRE_FALSE(answers->get());
    CHECK_THAT(answers->get().error().message(), Contains(how));
    CHECK(at.gate.asked == 0);
}

TEST_CASE("sealed: a listener that is none, or says that it is, does not get the client's words") {
    meeting at;
    auto calls = at.initiate(key('k'));
    std::string how;
    SECTION("it welcomes in frames") {
        ise::buffer out;
        ise::wire::welcome yes;
        ise::wire::put_frame(out, ise::wire::frame_type::welcome, 0, 0,
                             [&](ise::buffer& into) { ise::encode(yes, into); });
        at.say(*at.near_end, out.view());
        at.near_end->shutdown_write();
        how = "it has no shared key, or it is something else";
    }
    SECTION("it closes, as an earlier version does") {
        at.near_end->shutdown_write();
        how = "closed the connection when the sealed session was to begin";
    }
    SECTION("it sends an alert") {
        at.say(*at.near_end, ise::bytes_view(ise::net::tls::record_of(ise::net::tls::refusal::no_key)));
        at.near_end->shutdown_write();
        how = "no shared key is known there";
    }
    at.finish(calls);
    REQUIRE_FALSE(calls->get());
    CHECK_THAT(calls->get().error().message(), Contains(how));
}

TEST_CASE("sealed: over tcp and local, and not within a process, where nothing lies between") {
    sim_parties all;
    for (const char* host : {"boat", "shore"}) all.world.host(host).write_file("key", std::string(64, 'k'));
    ise::security_options with;
    with.key_file = "key";
    auto& boat = all.add("boat", {}, with);
    boat.provide(helm, [](set_mode asked) { return mode_set{true, asked.mode}; });
    boat.listen("tcp://0.0.0.0:7400");
    auto& shore = all.add("shore", {}, with);
    auto ask = [](ise::remote at) -> ise::task<ise::result<mode_set>> {
        set_mode hold{"hold"};
        auto got = co_await at.try_call(helm, hold, 5s);
        co_return got;
    };
    auto got = all.run(shore, ask(shore.at("tcp://boat:7400")));
    INFO((got ? "" : got.error().message()));
    CHECK(got);

    SECTION("a stranger who says a hello is told, and gets nothing else") {
        auto& sea = all.world.host("sea").start_process("sea");
        raw_peer stranger(all, sea, "tcp://boat:7400");
        stranger.greet();
        all.world.run_for(1s);
        CHECK(stranger.closed());
        REQUIRE(stranger.got.size() == 1);
        auto why = stranger.why(ise::wire::frame_type::reject);
        CHECK(why.code() == errc::unauthorized);
        CHECK_THAT(why.message(), Contains("a shared key is demanded here, and none was offered"));
    }
    SECTION("strangers who begin and stop hold no place that others need") {
        auto& sea = all.world.host("sea").start_process("sea");
        std::vector<std::unique_ptr<raw_peer>> crowd;
        for (int i = 0; i < 300; ++i) {
            crowd.push_back(std::make_unique<raw_peer>(all, sea, "tcp://boat:7400"));
            if (i % 2) crowd.back()->say(ise::as_bytes("\x16\x03\x01"));
        }
        all.world.run_for(10ms);
        auto still = all.run(shore, ask(shore.at("tcp://boat:7400")));
        CHECK(still);
        all.world.run_for(6s);
        CHECK(std::ranges::all_of(crowd, [](const auto& peer) { return peer->closed(); }));
        CHECK(boat.services->counts().sessions_accepted == 2);
    }
}

TEST_CASE("sealed: no request runs twice, whichever write fails behind records that went") {
    const int calls = GENERATE(40, 100); // of 1 KB: written from where they lie, and as a batch
    int answered = 0, lost = 0;
    for (std::uint64_t failing = 0; failing < 12; ++failing) {
        CAPTURE(calls, failing);
        sim_parties all;
        ise::security_options with;
        with.key_file = "key";
        for (const char* host : {"boat", "shore"}) all.world.host(host).write_file("key", std::string(64, 'k'));
        auto& boat = all.add("boat", {}, with);
        auto& shore = all.add("shore", {}, with);
        std::vector<int> runs(static_cast<std::size_t>(calls) + 1);
        boat.provide(helm, [&](set_mode asked) {
            ++runs.at(std::stoul(asked.mode));
            return mode_set{true, {}};
        });
        boat.listen("tcp://0.0.0.0:7400");
        auto there = shore.at("tcp://boat:7400");
        auto ask = [](ise::remote at, int number) -> ise::task<ise::result<mode_set>> {
            set_mode numbered{std::to_string(number) + std::string(1000, ' ')};
            auto got = co_await at.try_call(helm, numbered, 20s);
            co_return got;
        };
        REQUIRE(all.run(shore, ask(there, calls))); // which introduces the service
        all.world.run_for(100ms);
        std::vector<std::shared_ptr<started<ise::result<mode_set>>>> asked;
        {
            ise::loop::turn in(shore.on);
            for (int i = 0; i < calls; ++i) asked.push_back(start(shore.on, ask(there, i)));
            all.world.fail_at(failing);
        }
        all.world.run_for(30s);
        all.world.faults().fail_never();
        for (int i = 0; i < calls; ++i) {
            const auto& one = *asked[static_cast<std::size_t>(i)];
            const int ran = runs[static_cast<std::size_t>(i)];
            REQUIRE(one.done);
            REQUIRE(ran <= 1);
            if (*one.value) REQUIRE(ran == 1);
            else REQUIRE(one.value->error().executed() == ise::execution::unknown);
            ++(*one.value ? answered : lost);
        }
    }
    CHECK(answered > 0);
    CHECK(lost > 0);
}

TEST_CASE("sealed: a variable chooses the old scheme, and must be 0 or 1") {
    ise::sim::world world;
    world.host("a").write_file("key", std::string(64, 'k'));
    auto& env = world.host("a").start_process("a");
    ise::security_options with;
    with.key_file = "key";
    CHECK(ise::security::load(env, with).value().key->seals());
    env.set_variable("ISE_KEY_LEGACY", "1");
    CHECK_FALSE(ise::security::load(env, with).value().key->seals());
    env.set_variable("ISE_KEY_LEGACY", "yes");
    CHECK_THAT(ise::security::load(env, with).error().message(), Contains("ISE_KEY_LEGACY is 0 or 1, not 'yes'"));
}

TEST_CASE("sealed: how TLS begins is told apart from every frame of a greeting") {
    using ise::net::tls::asks_for_tls;
    auto of = [](std::string_view text) { return asks_for_tls(ise::as_bytes(text)); };
    CHECK(of("") == std::nullopt);
    CHECK(of("\x16") == std::nullopt);
    CHECK(of("\x16\x03") == std::nullopt);
    CHECK(of("\x16\x03\x01") == true);
    CHECK(of(std::string_view("\x16\x03\x00", 3)) == false);
    CHECK(of("\x17") == false);
    CHECK(of("\x16\x04") == false);
}

} // namespace sealed_test
