#include <ise/core/inproc_stream.hpp>
#include <ise/net/handshake.hpp>
#include <ise/packet/codec.hpp>
#include <ise/sim/world.hpp>

#include <asio/buffer.hpp>

#include <support/catch.hpp>
#include <support/party.hpp>

namespace handshake_test {

using namespace std::chrono_literals;
using namespace ise_test;
using ise::errc;
using ise::wire::frame_type;
using ise_test::Contains;
using made = ise::result<std::shared_ptr<ise::net::connection>>;

namespace {

struct channel final : ise::net::gatekeeper {
    std::optional<ise::failure> no;
    ise::wire::hello seen;
    ise::result<ise::wire::welcome> admit(const ise::wire::hello& caller) override {
        seen = caller;
        if (no) return *no;
        ise::wire::welcome yes;
        yes.self.path = "boat";
        return yes;
    }
};

struct fixture {
    ise::sim::world world;
    ise::sim::process& env = world.host("a").start_process("a");
    std::unique_ptr<ise::loop_host> host = env.make_loop("main");
    ise::loop& on = host->loop();
    std::unique_ptr<ise::stream> near, far;
    channel gate;
    fixture() { std::tie(near, far) = ise::make_inproc_pair(on, on, "pair"); }

    std::shared_ptr<started<made>> initiate(ise::wire::hello mine = {}) {
        mine.self.path = "shore";
        return start(on, ise::net::initiate(on, std::move(near), mine, on.now() + 5s));
    }
    std::shared_ptr<started<made>> respond() {
        return start(on, ise::net::respond(on, std::move(far), gate, on.now() + 5s));
    }
    void say(ise::stream& to, frame_type type, ise::bytes body) {
        ise::buffer out;
        ise::wire::put_frame(out, type, 0, 0, [&](ise::buffer& into) { into.append(ise::bytes_view(body)); });
        asio::const_buffer raw(out.data(), out.size());
        to.try_write(std::span(&raw, 1));
    }
    template <class... Started>
    void finish(const Started&... all) {
        REQUIRE(world.run_until([&] { return (all->done && ...); }, 1min));
    }
};

} // namespace

TEST_CASE("both sides know each other after the handshake") {
    fixture at;
    ise::wire::hello mine;
    mine.accepts.max_frame_bytes = 1; // less than everybody must accept
    mine.accepts.heartbeat_ns = 0;
    auto client = at.initiate(mine);
    auto server = at.respond();
    at.finish(client, server);
    REQUIRE((client->get() && server->get()));
    const auto& here = (*client->get())->terms();
    const auto& there = (*server->get())->terms();
    CHECK((here.peer.path == "boat" && there.peer.path == "shore"));
    CHECK((here.version == 1 && there.version == 1 && here.features == there.features));
    CHECK(there.peer_accepts.max_frame_bytes == ise::wire::min_frame_limit);
    CHECK(there.peer_accepts.heartbeat_ns >= 20'000'000);
}

TEST_CASE("who is not admitted learns why") {
    fixture at;
    at.gate.no.emplace(errc::wrong_peer, "here is 'boat', not 'buoy'");
    auto client = at.initiate();
    auto server = at.respond();
    at.finish(client, server);
    CHECK(client->get().error().code() == errc::wrong_peer);
    CHECK_THAT(client->get().error().message(), Contains("not 'buoy'"));
    CHECK(server->get().error().code() == errc::wrong_peer);
}

TEST_CASE("no common version is refused on both sides") {
    fixture at;
    ise::wire::hello mine;
    mine.oldest = 2;
    mine.newest = 9;
    auto client = at.initiate(mine);
    auto server = at.respond();
    at.finish(client, server);
    CHECK(client->get().error().code() == errc::version_mismatch);
    CHECK_THAT(client->get().error().message(), Contains("2 to 9"));
    CHECK(server->get().error().code() == errc::version_mismatch);
}

TEST_CASE("a later version that still speaks ours, with fields and features that we do not know, is welcome") {
    fixture at;
    ise::wire::hello theirs;
    theirs.newest = 7;
    theirs.features = ~std::uint64_t{0};
    auto body = ise::encode(theirs);
    body.insert(body.end(), 40, std::byte{1});
    at.say(*at.near, frame_type::hello, body);
    auto server = at.respond();
    at.finish(server);
    REQUIRE(server->get());
    CHECK((*server->get())->terms().version == 1);
    // What the gate says, within a process.
    CHECK((*server->get())->terms().features == (ise::wire::feature::first | ise::wire::feature::objects));
}

TEST_CASE("a stranger is turned away: garbage, another frame, a wrong mark, half a hello, much too much, silence") {
    fixture at;
    errc expected = errc::protocol_error;
    std::string limit;
    bool cut = false;
    SECTION("garbage") {
        ise::bytes raw(100, std::byte{'x'});
        asio::const_buffer all(raw.data(), raw.size());
        at.near->try_write(std::span(&all, 1));
        expected = errc::too_large; // its length is beyond every greeting
    }
    SECTION("another frame") { at.say(*at.near, frame_type::ping, {}); }
    SECTION("a wrong mark") {
        ise::wire::hello other;
        other.magic = 1;
        at.say(*at.near, frame_type::hello, ise::encode(other));
    }
    SECTION("half a hello") { at.say(*at.near, frame_type::hello, ise::bytes(3)); }
    SECTION("much too much") {
        at.say(*at.near, frame_type::hello, ise::bytes(20'000));
        expected = errc::too_large;
        limit = "greeting_bytes";
    }
    SECTION("silence") {
        expected = errc::timed_out;
        limit = "connect_time";
    }
    SECTION("a close") {
        cut = true;
        expected = errc::peer_lost;
    }
    auto server = at.respond();
    if (cut) at.near->close();
    auto begun = at.world.now();
    at.finish(server);
    CHECK(server->get().error().code() == expected);
    CHECK(at.world.now() - begun <= 5s);
    CHECK_THAT(server->get().error().message(), Contains(limit));
}

TEST_CASE("a listener that does not greet is given up at the deadline, and one that answers nonsense at once") {
    fixture at;
    auto client = at.initiate();
    errc expected = errc::timed_out;
    ise::wire::welcome odd;
    SECTION("silence") {}
    SECTION("a version that was not offered") {
        odd.version = 5;
        at.say(*at.far, frame_type::welcome, ise::encode(odd));
        expected = errc::version_mismatch;
    }
    SECTION("a request") {
        at.say(*at.far, frame_type::request, ise::bytes(20));
        expected = errc::protocol_error;
    }
    SECTION("an unreadable welcome") {
        at.say(*at.far, frame_type::welcome, ise::bytes(1));
        expected = errc::malformed;
    }
    at.finish(client);
    CHECK(client->get().error().code() == expected);
}

TEST_CASE("a handshake that is cancelled leaves nothing open") {
    fixture at;
    auto client = at.initiate();
    at.world.run_for(1s);
    client->cancel.emit(asio::cancellation_type::terminal);
    at.finish(client);
    if (!client->thrown) CHECK(client->get().error().code() == errc::cancelled);
    auto server = at.respond();
    at.finish(server); // its hello came, and then the end
    CHECK((server->get() || server->get().error().code() == errc::peer_lost));
}

} // namespace handshake_test
