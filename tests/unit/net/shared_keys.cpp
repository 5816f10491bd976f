// The proof that both sides of a handshake know one key: who has none, another one, or somebody else's words is
// refused.
#include <ise/core/inproc_stream.hpp>
#include <ise/net/handshake.hpp>
#include <ise/packet/codec.hpp>
#include <ise/sim/world.hpp>
#include <ise/transport/security.hpp>
#include <ise/transport/shared_key.hpp>
#include <ise/wire/body.hpp>

#include <asio/buffer.hpp>

#include <support/catch.hpp>
#include <support/party.hpp>

namespace shared_keys_test {

using namespace std::chrono_literals;
using namespace ise_test;
using ise::errc;
using ise::wire::frame_type;
using ise_test::Contains;
using made = ise::result<std::shared_ptr<ise::net::connection>>;
using key_ptr = std::shared_ptr<const ise::shared_key>;

namespace {

key_ptr key(char letter) { return ise::shared_key::make(std::string(64, letter), "a test").value(); }

struct channel final : ise::net::gatekeeper {
    int asked = 0;
    ise::result<ise::wire::welcome> admit(const ise::wire::hello&) override {
        ++asked;
        ise::wire::welcome yes;
        yes.self.path = "boat";
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
    channel gate;
    tamper to_responder, to_initiator;
    ise::bytes said_by_initiator, said_by_responder; ///< what passed
    std::vector<std::shared_ptr<started<void>>> passing;
    key_ptr shared = key('k'); ///< outlives the handshakes

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
    std::shared_ptr<started<made>> initiate(const ise::shared_key* with) {
        ise::wire::hello mine;
        mine.self.path = "shore";
        return start(on, ise::net::initiate(on, std::move(near), mine, on.now() + 5s, with));
    }
    std::shared_ptr<started<made>> respond(const ise::shared_key* with) {
        return start(on, ise::net::respond(on, std::move(far), gate, on.now() + 5s, with));
    }
    void connect() {
        passing.push_back(start(on, pass(*near_end, *far_end, to_responder, said_by_initiator)));
        passing.push_back(start(on, pass(*far_end, *near_end, to_initiator, said_by_responder)));
    }
    template <class... Started>
    void finish(const Started&... all) {
        REQUIRE(world.run_until([&] { return (all->done && ...); }, 1min));
    }
    void say(ise::stream& to, frame_type type, const auto& packet) {
        ise::buffer out;
        ise::wire::put_frame(out, type, 0, 0, [&](ise::buffer& into) { ise::encode(packet, into); });
        asio::const_buffer raw(out.data(), out.size());
        to.try_write(std::span(&raw, 1));
    }
};

struct outcome {
    made client, server;
    int asked = 0;
    std::size_t to_responder = 0, to_initiator = 0; ///< bytes that passed
};
outcome meet(const key_ptr& client, const key_ptr& server, meeting::tamper to_responder = {},
             meeting::tamper to_initiator = {}) {
    meeting at;
    at.to_responder = std::move(to_responder);
    at.to_initiator = std::move(to_initiator);
    auto calls = at.initiate(client.get());
    auto answers = at.respond(server.get());
    at.connect();
    at.finish(calls, answers);
    return {calls->get(), answers->get(), at.gate.asked, at.said_by_initiator.size(), at.said_by_responder.size()};
}

ise::wire::credentials said(std::string scheme, std::size_t bytes, std::uint8_t fill = 7) {
    ise::wire::credentials made;
    made.scheme = std::move(scheme);
    made.proof.assign(bytes, fill);
    return made;
}

} // namespace

TEST_CASE("key: both sides prove it and talk") {
    auto same = meet(key('k'), key('k'));
    REQUIRE((same.client && same.server));
    CHECK((*same.client)->terms().peer.path == "boat");
    CHECK((*same.server)->terms().peer.path == "shore");
}

TEST_CASE("key: another one is refused on both sides, and who comes with it learns nothing of who is here") {
    auto other = meet(key('k'), key('x'));
    REQUIRE_FALSE((other.client || other.server));
    CHECK(other.client.error().code() == errc::unauthorized);
    CHECK_THAT(other.client.error().message(), Contains("the shared key here is another one"));
    CHECK(other.server.error().code() == errc::unauthorized);
    CHECK_THAT(other.server.error().message(), Contains("the shared key here is another one"));
    CHECK(other.asked == 0);
}

TEST_CASE("key: who has none is told that one is demanded") {
    auto none = meet(nullptr, key('k'));
    REQUIRE_FALSE((none.client || none.server));
    CHECK(none.client.error().code() == errc::unauthorized);
    CHECK_THAT(none.client.error().message(),
               Contains("a shared key is demanded here, and none was offered") && Contains("--key"));
    CHECK(none.server.error().code() == errc::unauthorized);
    CHECK(none.asked == 0);
}

TEST_CASE("key: a listener that has none does not get in between") {
    auto none = meet(key('k'), nullptr);
    REQUIRE_FALSE((none.client || none.server));
    CHECK(none.client.error().code() == errc::unauthorized);
    CHECK_THAT(none.client.error().message(), Contains("no shared key is known here"));
    CHECK(none.asked == 0);
}

TEST_CASE("key: a listener that welcomes at once, without a proof or with a forged one, is refused") {
    meeting at;
    auto calls = at.initiate(at.shared.get());
    std::string how;
    ise::wire::welcome yes;
    yes.self.path = "boat";
    errc expected = errc::unauthorized;
    SECTION("without a challenge: as before there were keys") {
        at.say(*at.near_end, frame_type::welcome, yes);
        how = "it has no key, or is of a version that knows of none";
    }
    SECTION("a challenge, a welcome and no proof") {
        at.say(*at.near_end, frame_type::challenge, said("hmac-sha256", 32));
        at.say(*at.near_end, frame_type::welcome, yes);
        at.say(*at.near_end, frame_type::welcome, yes);
        how = "sent 'welcome' instead of a greeting";
        expected = errc::protocol_error;
    }
    SECTION("a forged proof") {
        at.say(*at.near_end, frame_type::challenge, said("hmac-sha256", 32));
        at.say(*at.near_end, frame_type::welcome, yes);
        at.say(*at.near_end, frame_type::proof, said("hmac-sha256", 32));
        how = "it has another key, or it is an impostor";
    }
    SECTION("an empty proof") {
        at.say(*at.near_end, frame_type::challenge, said("hmac-sha256", 32));
        at.say(*at.near_end, frame_type::welcome, yes);
        at.say(*at.near_end, frame_type::proof, said("hmac-sha256", 0));
        how = "it has another key";
    }
    SECTION("a challenge of another scheme") {
        at.say(*at.near_end, frame_type::challenge, said("none", 32));
        how = "its challenge is none of the scheme";
        expected = errc::protocol_error;
    }
    SECTION("a challenge without a nonce") {
        at.say(*at.near_end, frame_type::challenge, said("hmac-sha256", 0));
        how = "its challenge is none of the scheme";
        expected = errc::protocol_error;
    }
    at.finish(calls);
    REQUIRE_FALSE(calls->get());
    INFO(calls->get().error().message());
    CHECK(calls->get().error().code() == expected);
    CHECK_THAT(calls->get().error().message(), Contains(how));
}

TEST_CASE("key: what is no proof of it lets nobody in") {
    meeting at;
    auto answers = at.respond(at.shared.get());
    ise::wire::hello hello;
    hello.authentication = said("hmac-sha256", 32);
    auto proof = said("hmac-sha256", 32);
    std::string how = "the shared key here is another one";
    SECTION("32 bytes of something") {}
    SECTION("31 bytes") { proof.proof.pop_back(); }
    SECTION("no bytes") { proof.proof.clear(); }
    SECTION("another scheme in the proof") { proof.scheme = "none"; }
    SECTION("a short nonce") {
        hello.authentication.proof.pop_back();
        how = "something else was offered";
    }
    SECTION("another scheme") {
        hello.authentication.scheme = "plain";
        how = "something else was offered";
    }
    at.say(*at.far_end, frame_type::hello, hello);
    at.say(*at.far_end, frame_type::proof, proof);
    at.finish(answers);
    REQUIRE_FALSE(answers->get());
    CHECK(answers->get().error().code() == errc::unauthorized);
    CHECK_THAT(answers->get().error().message(), Contains(how));
    CHECK(at.gate.asked == 0);
}

TEST_CASE("key: what was overheard is worth nothing in the next handshake") {
    meeting first;
    auto calls = first.initiate(first.shared.get());
    auto answers = first.respond(first.shared.get());
    first.connect();
    first.finish(calls, answers);
    REQUIRE(calls->get());

    meeting again;
    again.env.random(); // another life: other nonces
    SECTION("to the side that was called") {
        auto once_more = again.respond(again.shared.get());
        asio::const_buffer raw(first.said_by_initiator.data(), first.said_by_initiator.size());
        again.far_end->try_write(std::span(&raw, 1));
        again.finish(once_more);
        REQUIRE_FALSE(once_more->get());
        CHECK(once_more->get().error().code() == errc::unauthorized);
        CHECK(again.gate.asked == 0);
    }
    SECTION("to the side that called") {
        auto once_more = again.initiate(again.shared.get());
        asio::const_buffer raw(first.said_by_responder.data(), first.said_by_responder.size());
        again.near_end->try_write(std::span(&raw, 1));
        again.finish(once_more);
        REQUIRE_FALSE(once_more->get());
        CHECK(once_more->get().error().code() == errc::unauthorized);
    }
}

TEST_CASE("key: an initiator's own proof is none of a responder, reflected to it") {
    meeting at;
    auto calls = at.initiate(at.shared.get());
    ise::wire::welcome yes;
    at.say(*at.near_end, frame_type::challenge, said("hmac-sha256", 32));
    ise::bytes room(4096);
    std::vector<ise::wire::credentials> proofs;
    auto listen = [](ise::stream& from, ise::bytes& into, std::vector<ise::wire::credentials>& found) -> ise::task<> {
        ise::wire::parser parser(16384);
        while (found.empty()) {
            auto got = co_await from.read_some(asio::buffer(into));
            if (got.problem) co_return;
            for (std::size_t fed = 0; fed < got.bytes;) {
                auto to = parser.prepare();
                auto count = std::min(to.size(), got.bytes - fed);
                std::copy_n(into.begin() + static_cast<std::ptrdiff_t>(fed), count, to.begin());
                parser.commit(count);
                fed += count;
                for (;;) {
                    auto frame = parser.next();
                    if (!frame || !*frame) break;
                    if ((*frame)->header.type == frame_type::proof)
                        found.push_back(ise::wire::read_body<ise::wire::credentials>((*frame)->body).value());
                }
            }
        }
    };
    auto hearing = start(at.on, listen(*at.near_end, room, proofs));
    at.finish(hearing);
    REQUIRE(proofs.size() == 1);
    at.say(*at.near_end, frame_type::welcome, yes);
    at.say(*at.near_end, frame_type::proof, proofs.front());
    at.finish(calls);
    REQUIRE_FALSE(calls->get());
    CHECK(calls->get().error().code() == errc::unauthorized);
}

TEST_CASE("key: whatever bit is changed on the way, there is no session at the side that would be deceived") {
    auto good = meet(key('k'), key('k'));
    REQUIRE(good.client);
    for (bool to_responder : {true, false}) {
        for (std::size_t place = 0; place < (to_responder ? good.to_responder : good.to_initiator); ++place) {
            INFO((to_responder ? "to the responder, byte " : "to the initiator, byte ") << place);
            meeting::tamper flip = [place](ise::bytes& piece, std::size_t before) {
                if (place >= before && place < before + piece.size()) piece[place - before] ^= std::byte{1};
            };
            auto bad = to_responder ? meet(key('k'), key('k'), flip) : meet(key('k'), key('k'), {}, flip);
            CHECK_FALSE(bad.client); // the welcome is bound to all that was said before
            if (to_responder) CHECK_FALSE(bad.server);
            if (bad.server) CHECK(bad.asked == 1);
        }
    }
}

TEST_CASE("key: the handshake is cut at every byte, and ends") {
    auto good = meet(key('k'), key('k'));
    for (bool to_responder : {true, false}) {
        for (std::size_t place = 0; place < (to_responder ? good.to_responder : good.to_initiator); ++place) {
            INFO((to_responder ? "to the responder, byte " : "to the initiator, byte ") << place);
            meeting at;
            auto& cut = to_responder ? at.to_responder : at.to_initiator;
            cut = [&at, place](ise::bytes& piece, std::size_t before) {
                if (before + piece.size() <= place) return;
                piece.resize(place > before ? place - before : 0);
                at.near_end->close();
                at.far_end->shutdown_write();
            };
            auto calls = at.initiate(at.shared.get());
            auto answers = at.respond(at.shared.get());
            at.connect();
            at.finish(calls, answers);
            CHECK_FALSE(calls->get());
        }
    }
}

TEST_CASE("key: what can be guessed is refused, and so is a file that is not there") {
    ise::sim::world world;
    auto& host = world.host("a");
    host.write_file("short", "secret\n");
    host.write_file("long", std::string(2000, 'x'));
    host.write_file("blank", "  \n\t\n");
    host.write_file("good", "\n " + std::string(32, 'x') + " \n");
    auto& env = host.start_process("a");
    CHECK_THAT(ise::shared_key::load(env, "short").error().message(),
               Contains("6 bytes") && Contains("openssl rand -hex 32"));
    CHECK(ise::shared_key::load(env, "long").error().code() == errc::too_large);
    CHECK_THAT(ise::shared_key::load(env, "blank").error().message(), Contains("0 bytes"));
    CHECK_THAT(ise::shared_key::load(env, "nowhere").error().message(), Contains("nowhere"));
    auto good = ise::shared_key::load(env, "good");
    REQUIRE(good);
    ise::bytes about(3, std::byte{1});
    CHECK((*good)->prove("a", about) ==
          ise::shared_key::make(std::string(32, 'x'), "a test").value()->prove("a", about));
    CHECK((*good)->prove("a", about) != (*good)->prove("b", about));
}

TEST_CASE("a node that demands credentials listens beyond its host with them only") {
    ise::security demanding;
    demanding.demanded = true;
    auto may = [&](const char* at) { return bool(demanding.may_listen(ise::endpoint::parse(at).value())); };
    for (const char* near : {"tcp://127.0.0.1:7400", "tcp://127.8.9.1:0", "tcp://[::1]:0", "udp://localhost:0",
                             "local://@boat", "local:///tmp/boat", "inproc://boat"})
        CHECK(may(near));
    for (const char* far :
         {"tcp://0.0.0.0:0", "tcp://[::]:0", "udp://10.0.0.1:1", "tcp://127.evil.example:1", "tcp://boat:1"})
        CHECK_FALSE(may(far));
    CHECK(may("tls://0.0.0.0:0"));
    auto refused = demanding.may_listen(ise::endpoint::parse("tcp://0.0.0.0:7400").value());
    CHECK(refused.error().code() == errc::unauthorized);
    CHECK_THAT(refused.error().message(), Contains("tcp://0.0.0.0:7400") && Contains("--key") && Contains("--tls"));
    demanding.key = key('k');
    CHECK(may("tcp://0.0.0.0:0"));
    demanding = {};
    CHECK(may("tcp://0.0.0.0:0"));
}

} // namespace shared_keys_test
